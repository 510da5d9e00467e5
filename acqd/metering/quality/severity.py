"""Flicker severity of IEC 61000-4-15: Pst from ten minutes of Pinst, Plt from two hours of Pst."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from acqd.arrays import Floats

SHORT_S, LONG_S = 600, 7200
"""Lengths of the intervals [s]."""
# Weight, and the percentages of the time at which Pinst is exceeded whose mean has it.
_TERMS = (
    (0.0314, (0.1,)),
    (0.0525, (0.7, 1.0, 1.5)),
    (0.0657, (2.2, 3.0, 4.0)),
    (0.28, (6.0, 8.0, 10.0, 13.0, 17.0)),
    (0.08, (30.0, 50.0, 80.0)),
)


def short_term(Pinst: Floats) -> Floats:
    """Pst of [phases, samples]."""
    levels = [percent for _, percents in _TERMS for percent in percents]
    exceeded = dict(zip(levels, np.percentile(Pinst, [100 - level for level in levels], axis=1), strict=True))
    total = sum(weight * np.mean([exceeded[p] for p in percents], axis=0) for weight, percents in _TERMS)
    return np.asarray(np.sqrt(total), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Severity:
    """Pst or Plt of one interval."""

    utc_ns: int
    """Start of the interval."""
    duration: float
    """s: 600 for Pst, 7200 for Plt."""
    value: Floats
    """[phases]; NaN where too much is missing."""
    flags: frozenset[str] = field(default_factory=frozenset)
    """`gap`: a part of the interval is missing. `interruption`: the voltage was below half of its mean."""


class LongTerm:
    """Plt: the cube root of the mean cube of twelve Pst, for whole even hours of UTC."""

    def __init__(self) -> None:
        self._parts: list[Severity] = []

    def take(self, part: Severity) -> Severity | None:
        """The next Pst; the Plt that it completes."""
        hour = LONG_S * 1_000_000_000
        if self._parts and part.utc_ns // hour != self._parts[0].utc_ns // hour:
            self._parts = []  # it was never completed
        self._parts.append(part)
        if part.utc_ns % hour + SHORT_S * 1_000_000_000 < hour:
            return None
        parts, self._parts = self._parts, []
        whole = len(parts) == LONG_S // SHORT_S
        cubes = np.array([one.value for one in parts]) ** 3
        value = np.cbrt(cubes.mean(axis=0)) if whole else np.full_like(part.value, np.nan)
        flags = frozenset().union(*(one.flags for one in parts), () if whole else ("gap",))
        return Severity(part.utc_ns // hour * hour, float(LONG_S), value, flags)
