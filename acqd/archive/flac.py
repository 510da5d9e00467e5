"""Reads FLAC in C (`flac.c`): what libFLAC writes for an archive, in a third of its time."""

from __future__ import annotations

import ctypes
import functools
import logging
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acqd.c_builds import flac
from acqd.compiling import cached_library
from acqd.errors import OperationError

_log = logging.getLogger(__name__)
_FRAME = 65_536
"""Samples of a frame at most."""


@functools.cache
def flac_library() -> ctypes.CDLL | None:
    """The library; None where it cannot be built."""
    try:
        return load_flac(cached_library(flac()))
    except (OperationError, OSError) as error:
        _log.warning("no FLAC with C: %s", error)
        return None


def load_flac(path: Path) -> ctypes.CDLL:
    """The library at `path`, with the types of its function."""
    loaded = ctypes.CDLL(str(path))
    integer, pointer = ctypes.c_int64, ctypes.c_void_p
    loaded.acqd_flac.argtypes = [ctypes.c_char_p, integer, integer, integer, integer, pointer, pointer]
    loaded.acqd_flac.restype = integer
    return loaded


def read_flac(data: bytes, samples: int, channels: int, bits: int) -> NDArray[np.int16 | np.int32] | None:
    """Codes [samples, channels] of 16 or 24 `bits`, the latter as 32; None for what is left to libsndfile."""
    library = flac_library()
    if library is None or samples * channels > _FRAME * len(data):
        return None
    out = np.empty((samples, channels), np.int16 if bits == 16 else np.int32)
    scratch = np.empty(_FRAME, np.int32)
    failed = library.acqd_flac(data, len(data), channels, samples, bits, scratch.ctypes.data, out.ctypes.data)
    return None if failed else out
