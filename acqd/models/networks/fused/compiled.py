"""Compile `lstm.c` at first use with the system's compiler, for the widest vectors of the processor."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

from acqd.compiling import cached_library
from acqd.errors import OperationError
from acqd.instruction_sets import InstructionSet, best_instruction_set

_SOURCE = Path(__file__).with_name("lstm.c")
_FLAGS = ("-O3", "-std=gnu11", "-fPIC", "-shared", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")


@functools.cache
def library(instructions: InstructionSet | None = None) -> ctypes.CDLL:
    """The compiled library, from the cache or freshly built. Raises OperationError."""
    chosen = instructions or best_instruction_set()
    flags = [*_FLAGS, *chosen.options, f"-DV={chosen.lanes}"]
    try:
        path = cached_library(f"lstm-{chosen.name}", _SOURCE, flags)
    except OperationError as error:
        raise OperationError(f"{error}; or train with --compute torch") from None
    loaded = ctypes.CDLL(str(path))
    loaded.acqd_lstm.restype = ctypes.c_double
    loaded.acqd_scratch.restype = ctypes.c_long
    return loaded
