"""How much memory one input took at most: the high-water mark of Linux, reset before it."""

from __future__ import annotations

from pathlib import Path

from tools.studies.fuzz.mutate import Files

FACTOR = 3
"""Bytes of memory for a byte of the input ..."""
ALLOWANCE = 64 << 20
"""... and for what libraries keep [bytes]."""


def reset_peak() -> int:
    """Makes the memory in use the high-water mark [bytes]."""
    Path("/proc/self/clear_refs").write_text("5")
    return _status("VmRSS")


def excess(files: Files, before: int) -> str:
    """What to say of an input that took more memory than `FACTOR` times its size; empty for all others."""
    took, size = _status("VmHWM") - before, sum(map(len, files.values()))
    return f"more than {FACTOR} times the input's size of memory" if took > FACTOR * size + ALLOWANCE else ""


def _status(name: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(name))
