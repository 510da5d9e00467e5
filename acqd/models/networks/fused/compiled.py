"""Compile `lstm.c` at first use with the system's compiler, for the widest vectors of the processor."""

from __future__ import annotations

import ctypes
import functools

from acqd.c_builds import lstm
from acqd.compiling import cached_library
from acqd.errors import OperationError
from acqd.instruction_sets import InstructionSet, best_instruction_set


@functools.cache
def library(instructions: InstructionSet | None = None) -> ctypes.CDLL:
    """The compiled library, from the cache or freshly built. Raises OperationError."""
    chosen = instructions or best_instruction_set()
    try:
        path = cached_library(lstm(chosen))
    except OperationError as error:
        raise OperationError(f"{error}; or train with --compute torch") from None
    loaded = ctypes.CDLL(str(path))
    loaded.acqd_lstm.restype = ctypes.c_double
    loaded.acqd_scratch.restype = ctypes.c_long
    return loaded
