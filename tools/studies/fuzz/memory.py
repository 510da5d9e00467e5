"""How much memory one input took at most: the high-water mark of Linux.

That of the memory of today: `ru_maxrss` never falls below the mark of the process that this one was forked from.
"""

from __future__ import annotations

from pathlib import Path

from tools.studies.fuzz.mutate import Files

FACTOR = 3
"""Bytes of memory for a byte of the input ..."""
ALLOWANCE = 64 << 20
"""... and for what libraries keep [bytes]."""
_NEWS = ALLOWANCE // 16
"""To set the mark back takes as long as to read a row, so it is done only when it has risen by this [bytes]."""


class Peak:
    """The high-water mark of this process, from one input to the next."""

    def __init__(self) -> None:
        self._floor = _reset()

    def excess(self, files: Files) -> str:
        """What to say of an input that took more than `FACTOR` times its size of memory; empty for all others."""
        took, size = _mark() - self._floor, sum(map(len, files.values()))
        if took > _NEWS:
            self._floor = _reset()
        return f"more than {FACTOR} times the input's size of memory" if took > FACTOR * size + ALLOWANCE else ""


def _reset() -> int:
    """Make the memory in use the high-water mark [bytes]."""
    Path("/proc/self/clear_refs").write_text("5")
    return _mark()


def _mark() -> int:
    """The high-water mark [bytes]."""
    status = Path("/proc/self/status").read_bytes()
    at = status.index(b"VmHWM:") + len(b"VmHWM:")
    return int(status[at : status.index(b"kB", at)]) * 1024
