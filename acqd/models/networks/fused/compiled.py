"""Compile `lstm.c` at first use with the system's compiler, for the widest vectors of the processor."""

from __future__ import annotations

import ctypes
import functools

from acqd.c_builds import lstm
from acqd.compiling import loaded_library
from acqd.instruction_sets import InstructionSet, best_instruction_set


@functools.cache
def library(instructions: InstructionSet | None = None) -> ctypes.CDLL:
    """The compiled library, from the cache or freshly built. Raises OperationError."""
    loaded = loaded_library(lstm(instructions or best_instruction_set()))
    loaded.acqd_lstm.restype = ctypes.c_double
    loaded.acqd_scratch.restype = ctypes.c_long
    return loaded
