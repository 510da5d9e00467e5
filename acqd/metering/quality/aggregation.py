"""150/180-cycle, 10 min and 2 h values from shorter ones (IEC 61000-4-30:2015, sections 4.4 and 4.5)."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.metering.quality.values import LISTS, PHASE, SYSTEM, Kind, QualityValues, Rule

_RULES: dict[str, Rule] = {name: quantity.rule for name, quantity in (PHASE | LISTS | SYSTEM).items()}


class _Mean:
    """Running mean of one quantity by its rule; NaN are left out."""

    def __init__(self, rule: Rule) -> None:
        self._rule = rule
        self._sum: np.ndarray | float = 0.0
        self._count: np.ndarray | float = 0.0

    def add(self, value: Floats | float) -> None:
        x = np.asarray(value, dtype=np.float64)
        known = ~np.isnan(x)
        self._sum = self._sum + np.where(known, self._forward(x), 0.0)
        self._count = self._count + known

    def value(self) -> Floats:
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = self._sum / np.asarray(self._count, dtype=np.float64)
        if self._rule == "rms":
            return np.asarray(np.sqrt(mean))
        return np.asarray(np.degrees(np.angle(mean)) if self._rule == "angle" else mean)

    def _forward(self, x: Floats) -> np.ndarray:
        if self._rule == "rms":
            return np.asarray(x * x)
        return np.asarray(np.exp(1j * np.radians(x)) if self._rule == "angle" else x)


class Aggregate:
    """One aggregation interval in progress."""

    def __init__(self, kind: Kind) -> None:
        self._kind = kind
        self._phase: dict[str, _Mean] = {}
        self._system: dict[str, _Mean] = {}
        self._f, self._rocof = _Mean("mean"), _Mean("mean")
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
        self.count += 1
        self._intervals += values.intervals
        self._duration += values.duration
        self._f.add(values.f)
        self._rocof.add(values.rocof)
        for means, quantities in ((self._phase, values.phase), (self._system, values.system)):
            for name, value in quantities.items():
                means.setdefault(name, _Mean(_RULES[name])).add(value)
        self._flags |= values.flags
        for flags, more in zip(self._phase_flags, values.phase_flags, strict=True):
            flags |= more

    @property
    def covered(self) -> float:
        """s that the values added are of."""
        return self._duration

    def close(self, *more_flags: str) -> QualityValues:
        """The value of the interval (at least one was added)."""
        return QualityValues(
            kind=self._kind,
            utc_ns=self._begin,
            duration=self._duration,
            intervals=self._intervals,
            f=float(self._f.value()),
            rocof=float(self._rocof.value()),
            phase={name: mean.value() for name, mean in self._phase.items()},
            system={name: float(mean.value()) for name, mean in self._system.items()},
            flags=frozenset(self._flags | set(more_flags)),
            phase_flags=[frozenset(flags) for flags in self._phase_flags],
        )
