"""Ending in order when asked to: what a tool has started ends with it."""

from __future__ import annotations

import signal
from types import FrameType


def end_in_order() -> None:
    """SIGTERM and SIGINT unwind the stack (a background process of a shell ignores SIGINT otherwise)."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _unwind)


def _unwind(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
