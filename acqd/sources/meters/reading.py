"""One round of reading a meter."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reading:
    """What the registers of one meter said."""

    meter: str
    """Device name of its rows."""
    phases: int
    seq: int
    """Number of the round since the start; a missed round leaves a hole."""
    utc_ns: int
    """UTC at which the answers had arrived."""
    values: dict[str, float | None]
    """By the names of profile.NAMES; V, A, W, VA, 1, Hz, kWh."""
    flags: frozenset[str]
