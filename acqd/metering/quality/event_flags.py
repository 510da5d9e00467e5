"""Flags of an interval from Urms(1/2): RMS of one cycle, refreshed every half cycle (IEC 61000-4-30, section 5.4.1)."""

from __future__ import annotations

from acqd.arrays import Floats

DIP, SWELL, INTERRUPTION = 0.90, 1.10, 0.05
"""Shares of the declared voltage (EN 50160)."""


def event_flags(rms: Floats, declared: float) -> set[str]:
    """Flags of an interval whose one-cycle RMS values are `rms` [phases, n]: "dip", "swell", "interruption".

    One phase suffices for a dip or a swell; an interruption is one of all phases at once.
    """
    flags = set()
    if (rms < DIP * declared).any():
        flags.add("dip")
    if (rms > SWELL * declared).any():
        flags.add("swell")
    if (rms < INTERRUPTION * declared).all(axis=0).any():
        flags.add("interruption")
    return flags
