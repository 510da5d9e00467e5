"""A period beside the one before: energies where rows of both are there, else mean powers."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.energy.account import Period

_COMPARABLE = 0.99
"""Least share of a range with rows for a comparison of energies; below, mean powers are compared."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """A range beside the one before."""

    quantity: str
    """kWh, or mean W where rows lack in one of the two."""
    now: float
    before: float
    begin: int
    """Unix s of the range before."""
    end: int

    @property
    def change(self) -> float | None:
        """Relative; None where the value before is 0."""
        return None if not self.before else self.now / self.before - 1


def compare(total: Period, before: Period) -> Comparison | str:
    """The comparison, or why there can be no comparison."""
    if total.kWh is None or before.kWh is None:
        return "no energy is known of one of the two periods"
    shares = [one.known_s / (one.end - one.begin) for one in (total, before)]
    if min(shares) >= _COMPARABLE:
        return Comparison("kWh", total.kWh, before.kWh, before.begin, before.end)
    if total.mean_W is None or before.mean_W is None:
        return "rows lack in one of the two periods"
    return Comparison("mean W", total.mean_W, before.mean_W, before.begin, before.end)
