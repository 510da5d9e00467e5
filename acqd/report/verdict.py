"""The tile on top of a report: what was found, how much, how sure, and what to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Tone = Literal["found", "fine", "open", "bad"]
"""A cause was found; all is well; a question is open; something is wrong."""


@dataclass(frozen=True, slots=True)
class KeyFigure:
    """One number of the tile."""

    label: str
    value: str
    note: str = ""
    """Interval and number of recordings, or what the number is compared with."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a reader in a hurry takes away."""

    tone: Tone
    headline: str
    sentence: str = ""
    figures: list[KeyFigure] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)
    """What to do next."""
    warnings: list[str] = field(default_factory=list)
    """What makes the verdict less than it seems."""
