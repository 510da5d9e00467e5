"""Bars for a ranking: linear, relative to the largest value, or to the whole that the values are shares of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

BarColour = Literal["before", "after", "muted"]


@dataclass(frozen=True, slots=True)
class Bar:
    """One row of a ranking."""

    name: str
    value: float
    shown: str
    """The value as text, with its unit."""
    colour: BarColour = "before"
    hover: str = ""

    def share(self, of: float) -> float:
        """Length in percent of a full bar."""
        return round(100 * max(self.value, 0.0) / of, 2) if of > 0 else 0.0


@dataclass(frozen=True, slots=True)
class Bars:
    """A ranking."""

    rows: list[Bar]
    quantity: str
    """What the lengths are, with unit."""
    whole: float | None = None
    """The value of a full bar; None: the largest."""

    @property
    def longest(self) -> float:
        """The value of a full bar."""
        return max((row.value for row in self.rows), default=0.0) if self.whole is None else self.whole


def ranked(rows: Sequence[Bar], quantity: str, *, smaller_is_better: bool = False, whole: float | None = None) -> Bars:
    """Bars with the winner first; `whole`: the value of a full bar."""
    return Bars(sorted(rows, key=lambda row: row.value, reverse=not smaller_is_better), quantity, whole)
