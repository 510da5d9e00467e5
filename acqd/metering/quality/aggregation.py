"""150/180-cycle, 10 min and 2 h values from shorter ones (IEC 61000-4-30:2015, sections 4.4 and 4.5)."""

from __future__ import annotations

import math

import numpy as np

from acqd.arrays import Floats
from acqd.metering.quality.values import LISTS, PHASE, SYSTEM, Kind, QualityValues, Rule

_RULES: dict[str, Rule] = {name: quantity.rule for name, quantity in (PHASE | LISTS | SYSTEM).items()}
_AT_ONCE = 15
"""Values that are added at a time: an addition costs more than its numbers."""


class _Means:
    """Running means of all quantities of values at once, each by its rule; NaN are left out."""

    def __init__(self, values: QualityValues) -> None:
        self._phase = {name: np.shape(value) for name, value in values.phase.items()}
        self._system = list(values.system)
        sizes = [math.prod(shape) for shape in self._phase.values()]
        rules = np.repeat([_RULES[name] for name in self._phase], sizes).tolist()
        rules += [_RULES[name] for name in self._system] + ["mean", "mean"]  # f and its rate
        self._rms = np.array([rule in {"rms", "under", "over"} for rule in rules])
        self._angles = np.flatnonzero([rule == "angle" for rule in rules])
        self._distances = np.flatnonzero([rule in {"under", "over"} for rule in rules])
        self._sides = np.array([1.0 if rules[at] == "over" else -1.0 for at in self._distances])
        self._sum, self._count = np.zeros(len(rules)), np.zeros(len(rules))
        self._rows, self._taken = np.empty((_AT_ONCE, len(rules))), 0
        self._phasors = np.zeros(len(self._angles), dtype=np.complex128)
        self._ends = np.cumsum(sizes)

    def add(self, values: QualityValues) -> None:
        """Take the values of the next interval: of the same quantities."""
        self._rows[self._taken] = values.numbers()
        self._taken += 1
        if self._taken == _AT_ONCE:
            self._fold()

    def _fold(self) -> None:
        """Add the rows that wait to the sums."""
        x, self._taken = self._rows[: self._taken], 0
        x[:, self._distances] = 100 + self._sides * x[:, self._distances]
        known = ~np.isnan(x)
        angles = x[:, self._angles]
        self._phasors += np.where(known[:, self._angles], np.exp(1j * np.radians(angles)), 0.0).sum(axis=0)
        x[:, self._rms] *= x[:, self._rms]
        x[~known] = 0.0
        self._sum += x.sum(axis=0)
        self._count += known.sum(axis=0)

    def close(self) -> tuple[dict[str, Floats], dict[str, float], float, float]:
        """Means of the phases and of the system, f and its rate of change."""
        self._fold()
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = self._sum / self._count
            mean[self._rms] = np.sqrt(mean[self._rms])
            mean[self._distances] = self._sides * (mean[self._distances] - 100)
            mean[self._angles] = np.degrees(np.angle(self._phasors / self._count[self._angles]))
        parts = np.split(mean, self._ends)
        phase = {name: part.reshape(shape) for (name, shape), part in zip(self._phase.items(), parts, strict=False)}
        *system, f, rocof = parts[-1].tolist()
        return phase, dict(zip(self._system, system, strict=True)), f, rocof


class Aggregate:
    """One aggregation interval in progress."""

    def __init__(self, kind: Kind) -> None:
        self._kind = kind
        self._means: _Means | None = None
        self._flags: set[str] = set()
        self._phase_flags: list[set[str]] = []
        self._begin = 0
        self.count = 0
        """Values added."""
        self._intervals = 0
        self._duration = 0.0

    def add(self, values: QualityValues) -> None:
        """Take the next shorter value."""
        if not self.count:
            self._begin = values.utc_ns
            self._phase_flags = [set() for _ in values.phase_flags]
        if self._means is None:
            self._means = _Means(values)
        self.count += 1
        self._intervals += values.intervals
        self._duration += values.duration
        self._means.add(values)
        self._flags |= values.flags
        for flags, more in zip(self._phase_flags, values.phase_flags, strict=True):
            flags |= more

    @property
    def covered(self) -> float:
        """s that the values added are of."""
        return self._duration

    def close(self, *more_flags: str) -> QualityValues:
        """The value of the interval (at least one was added)."""
        assert self._means is not None
        phase, system, f, rocof = self._means.close()
        return QualityValues(
            kind=self._kind,
            utc_ns=self._begin,
            duration=self._duration,
            intervals=self._intervals,
            f=f,
            rocof=rocof,
            phase=phase,
            system=system,
            flags=frozenset(self._flags | set(more_flags)),
            phase_flags=[frozenset(flags) for flags in self._phase_flags],
        )
