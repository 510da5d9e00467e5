"""Compiles `window.c` and `quality.c` at first use, for the widest vectors of the processor."""

from __future__ import annotations

import ctypes
import functools
import logging
import os
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.c_builds import WINDOW_FALLBACK, quality, window
from acqd.compiling import cached_library
from acqd.errors import OperationError
from acqd.instruction_sets import InstructionSet, best_instruction_set

_log = logging.getLogger(__name__)
SWITCH = "ACQD_METERING"
"""Environment variable: "numpy" for the path without C, or the file of a library that was built elsewhere."""


def library(channels: int, instructions: InstructionSet | None = None) -> ctypes.CDLL:
    """The library for this number of channels, from the cache or freshly built. Raises OperationError."""
    given = os.environ.get(SWITCH)
    if given:
        return load(Path(given))
    chosen = instructions or best_instruction_set()
    return load(cached_library(window(channels, chosen)))


def load(path: Path) -> ctypes.CDLL:
    """The library at `path`, with the types of its functions. Raises OSError for a file that is no library.

    Raises OperationError for the library of another acqd.
    """
    loaded = ctypes.CDLL(str(path))
    try:
        one, quiet, undo = loaded.acqd_window, loaded.acqd_quiet, loaded.acqd_undo
    except AttributeError as error:
        raise OperationError(f"{path}: built from the window.c of another acqd ({error}); build it again") from None
    pointer = ctypes.c_void_p
    loaded.acqd_windows.restype = ctypes.c_int64
    loaded.acqd_windows.argtypes = [*[pointer] * 5, ctypes.c_int64, pointer]
    # These take a `c_void_p`. Declared types would be converted at each call, which takes longer than all else in it.
    one.restype = quiet.restype = ctypes.c_int64
    undo.restype = None
    return loaded


@functools.cache
def usable_library(channels: int) -> ctypes.CDLL | None:
    """The library; None, and one line in the log, where it cannot be built or is not wanted."""
    reason = why_not(channels)
    if reason is None:
        return library(channels)
    _log.warning("not metering with C: %s", reason)
    return None


@functools.cache
def why_not(channels: int = 6) -> str | None:
    """Why windows are metered with numpy, in words; None where they are with C."""
    if os.environ.get(SWITCH) == "numpy":
        return f"{SWITCH}=numpy: {WINDOW_FALLBACK}"
    try:
        library(channels)
    except (OperationError, OSError) as error:
        return str(error)
    return None


@functools.cache
def quality_library() -> ctypes.CDLL | None:
    """The library of power quality and events; None where it cannot be built or no C is wanted (`SWITCH`)."""
    if os.environ.get(SWITCH) == "numpy":
        return None
    try:
        return load_quality(cached_library(quality(best_instruction_set())))
    except (OperationError, OSError) as error:
        _log.warning("no power quality with C: %s", error)
        return None


def load_quality(path: Path) -> ctypes.CDLL:
    """The library at `path`, with the types of its functions."""
    loaded = ctypes.CDLL(str(path))
    pointer, integer, number = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
    rows = (pointer, integer, integer, integer)  # numbers, how many rows, their distance and length
    loaded.acqd_resample.argtypes = [*rows, number, number, integer, pointer, integer, integer, pointer, pointer]
    loaded.acqd_half_cycle_integrals.argtypes = [*rows, number, number, integer, *[pointer] * 3]
    loaded.acqd_cycle_phasors.argtypes = [*rows, number, number, integer, *[pointer] * 4]
    loaded.acqd_groups.argtypes = [pointer, integer, integer, integer, *[pointer] * 3]
    loaded.acqd_half_cycles.argtypes = [
        *(pointer, pointer, pointer, integer, integer, integer, pointer, number, number),
        *(pointer, integer, pointer, pointer, integer, pointer),
    ]
    codes = (pointer, integer, integer, integer)  # codes, bits, channels or phases, samples or parts
    loaded.acqd_physical.argtypes = [*codes, pointer, pointer]
    loaded.acqd_look.argtypes = [*codes, integer, pointer]
    loaded.acqd_tops.argtypes = [*codes, pointer, pointer, pointer]
    loaded.acqd_calm.argtypes = [*codes, pointer, integer, integer, *[pointer] * 3]
    loaded.acqd_calm.restype = integer
    loaded.acqd_mean_squares.argtypes = [*codes, integer, pointer, pointer]
    loaded.acqd_filter.argtypes = [pointer, pointer, pointer, number, integer, pointer, *rows, pointer]
    for function in (
        loaded.acqd_physical, loaded.acqd_look, loaded.acqd_tops, loaded.acqd_mean_squares, loaded.acqd_resample,
        loaded.acqd_half_cycle_integrals, loaded.acqd_cycle_phasors, loaded.acqd_groups, loaded.acqd_half_cycles,
        loaded.acqd_filter,
    ):  # fmt: skip
        function.restype = None
    return loaded


def as_rows(x: Floats) -> Floats:
    """`x` [rows, samples], or a copy of it where its samples do not lie next to each other."""
    fits = x.dtype == np.float64 and x.strides[1] == 8 and x.strides[0] % 8 == 0
    return x if fits else np.ascontiguousarray(x, dtype=np.float64)


def rows_of(x: Floats) -> tuple[int, int, int, int]:
    """How C takes an array of `as_rows`, which the caller keeps alive: address, rows, their distance, samples."""
    return x.ctypes.data, x.shape[0], x.strides[0] // 8, x.shape[1]
