"""Memory that a process holds, but does not use."""

from __future__ import annotations

import ctypes


def release_freed() -> None:
    """Give freed memory back to the operating system: glibc keeps what large arrays leave behind."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # other C libraries have no such function
    if trim is not None:
        trim(0)
