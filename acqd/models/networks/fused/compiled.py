"""Compile `lstm.c` at first use with the system's compiler, for the widest vectors of the processor."""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass
from pathlib import Path

from acqd.compiling import cached_library
from acqd.errors import OperationError

_SOURCE = Path(__file__).with_name("lstm.c")
_FLAGS = ("-O3", "-std=gnu11", "-fPIC", "-shared", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")


@dataclass(frozen=True, slots=True)
class InstructionSet:
    """Compiler options, and the number of sequences in a vector."""

    name: str
    needs: tuple[str, ...]
    """Flags in /proc/cpuinfo."""
    options: tuple[str, ...]
    lanes: int


INSTRUCTION_SETS = (
    InstructionSet("avx512", ("avx512f", "avx512dq", "fma"), ("-mavx512f", "-mavx512dq", "-mfma"), 16),
    InstructionSet("avx2", ("avx2", "fma"), ("-mavx2", "-mfma"), 8),
    InstructionSet("portable", (), (), 4),
)
"""Widest first. "portable" takes the compiler's default: SSE2 on x86-64, NEON on ARM."""


def best_instruction_set() -> InstructionSet:
    """The widest instruction set of this processor."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace")
    except OSError:
        text = ""
    flags = set(next((line for line in text.splitlines() if line.startswith("flags")), "").split())
    return next(candidate for candidate in INSTRUCTION_SETS if flags.issuperset(candidate.needs))


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
