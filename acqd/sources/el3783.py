"""The Beckhoff EL3783 terminal: scaling (16 bit, LSB = measuring-range end value / 32768) and status word."""

from __future__ import annotations

from typing import Literal

U_V_PER_DIGIT = 737.2575 / 32768
"""22.5 mV."""
CurrentRange = Literal[1, 5]
I_A_PER_DIGIT: dict[CurrentRange, float] = {5: 9.207527 / 32768, 1: 1.8415054 / 32768}
"""281 uA in the 5 A range, 56.2 uA in the 1 A range."""
AUTO_GAIN = 5
"""5 A range / 1 A range."""
RATE = 20_000.0
"""Samples/s at 50 us conversion time."""

# Bits of a status word: subindex k of object 0x6000 + 0x10 * channel is bit k - 1.
UNDERRANGE, OVERRANGE, ERROR, SYNC_ERROR, INVALID = 1 << 0, 1 << 1, 1 << 6, 1 << 13, 1 << 14


def status_flags(status: int) -> frozenset[str]:
    """Row flags of a status word, or of several joined by OR."""
    flags = set()
    if status & (OVERRANGE | UNDERRANGE):
        flags.add("overrange")
    if status & SYNC_ERROR:
        flags.add("sync_error")
    if status & INVALID or (status & ERROR and not flags):  # over-range sets the error bit too
        flags.add("invalid")
    return frozenset(flags)
