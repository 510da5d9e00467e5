"""Compiles `lstm.c` with the system's compiler at first use, for the widest vectors this processor has."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from acqd.errors import OperationError

_SOURCE = Path(__file__).with_name("lstm.c")
_FLAGS = ("-O3", "-std=gnu11", "-fPIC", "-shared", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")


@dataclass(frozen=True, slots=True)
class InstructionSet:
    """What the compiler is told, and how many sequences a vector holds."""

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
"""Widest first. "portable" is what the compiler assumes anyway: SSE2 on x86-64, NEON on ARM."""


def best_instruction_set() -> InstructionSet:
    """The widest that this processor has."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace")
    except OSError:
        text = ""
    flags = set(next((line for line in text.splitlines() if line.startswith("flags")), "").split())
    return next(each for each in INSTRUCTION_SETS if flags.issuperset(each.needs))


def compiler() -> str | None:
    """The system's C compiler."""
    names = [os.environ.get("CC"), "cc", "gcc", "clang"]
    return next((found for name in names if name and (found := shutil.which(name))), None)


@functools.cache
def library(instructions: InstructionSet | None = None) -> ctypes.CDLL:
    """The compiled function, from the cache or built now. Raises OperationError."""
    chosen = instructions or best_instruction_set()
    path = _cached(chosen)
    if not path.exists():
        _build(chosen, path)
    loaded = ctypes.CDLL(str(path))
    loaded.acqd_lstm.restype = ctypes.c_double
    loaded.acqd_scratch.restype = ctypes.c_long
    return loaded


def _cached(chosen: InstructionSet) -> Path:
    """In the user's cache, named by what it was made from: another processor or version makes its own."""
    digest = hashlib.sha256(_SOURCE.read_bytes() + " ".join(_FLAGS + chosen.options).encode()).hexdigest()[:16]
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "acqd" / f"lstm-{chosen.name}-{digest}.so"


def _build(chosen: InstructionSet, path: Path) -> None:
    command = compiler()
    if command is None:
        raise OperationError("no C compiler found (cc, gcc, clang): install one, or train with --compute torch")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".so")
        os.close(handle)
    except OSError as error:
        raise OperationError(f"{path.parent}: {error.strerror}; set XDG_CACHE_HOME to a folder to write in") from None
    beside = Path(name)
    try:
        arguments = [command, *_FLAGS, *chosen.options, f"-DV={chosen.lanes}", str(_SOURCE), "-o", name]
        done = subprocess.run(arguments, capture_output=True, text=True, check=False)
        if done.returncode:
            reason = (done.stderr.strip().splitlines() or ["no message"])[0]
            raise OperationError(f"{command} cannot compile {_SOURCE.name} ({reason}); train with --compute torch")
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
