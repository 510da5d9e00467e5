"""The cycle of a recorded log: stretches keep their paths, and follow laws that no program has to express."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from itertools import chain

import numpy as np

from acqd.arrays import Floats
from acqd.motion.controller import RATE, Motion
from acqd.motion.program_file import Program
from acqd.saving.cycle import Rest, Stretch, continuous, joined
from acqd.saving.plan import UNIFORM, Change, Cycle, Piece, Timing
from acqd.saving.power import Meter
from acqd.saving.sharing import Curve
from acqd.saving.time_law import Bounds, Path

ALONG = "along the path"
_FACTORS = (0.6, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 3.0)
"""Durations at which laws are sought, as shares of the old one."""


class StretchTiming(Timing):
    """Laws of one stretch for several durations."""

    laws = (ALONG,)

    def __init__(self, stretch: Stretch, bounds: Bounds, meter: Meter) -> None:
        """Seek the laws of least energy."""
        self.seconds = stretch.seconds
        self._path = path = Path(stretch.motion, bounds, meter.grey)
        found: dict[float, Floats | None] = {1.0: path.best(stretch.seconds, path.uniform)}
        middle = _FACTORS.index(1.0)
        for factors in (_FACTORS[middle + 1 :], _FACTORS[:middle][::-1]):
            law = found[1.0]
            for factor in factors:
                if law is not None:
                    found[factor] = law = path.best(factor * stretch.seconds, law)
        laws = {factor * stretch.seconds: law for factor, law in sorted(found.items()) if law is not None}
        self._curve = Curve.hull(np.array([*laws]), np.array([path.energy(law, s) for s, law in laws.items()]))
        every = list(laws.values())
        self._laws = [every[k] for k in self._curve.number]

    def curve(self, law: str) -> Curve:  # noqa: ARG002
        """Of the laws of least energy."""
        return self._curve

    def motion(self, law: str, seconds: float) -> Motion:
        """The stretch with a duration: by the law of the next shorter duration, slowed uniformly."""
        return self._path.motion_at(self._coefficients(law, seconds), seconds)

    def unlike(self, law: str, seconds: float) -> float:
        """From the pace."""
        return self._path.unlike(self._coefficients(law, seconds), seconds)

    def _coefficients(self, law: str, seconds: float) -> Floats:
        number = int(np.searchsorted(self._curve.seconds, seconds + 1e-9, side="right")) - 1
        return self._path.uniform if law == UNIFORM else self._laws[max(number, 0)]


class LogCycle(Cycle):
    """Pieces of a recorded motion."""

    def __init__(self, parts: Sequence[Rest | Stretch], bounds: Bounds, meter: Meter, least_rest: float) -> None:
        self.meter, self.least_rest, self._bounds = meter, least_rest, bounds
        self._sought: dict[int, StretchTiming] = {}
        self._set(parts)

    def with_parts(self, parts: Sequence[Rest | Stretch], strange_s: float) -> LogCycle:
        """Other pieces; the laws of stretches that stay are not sought again."""
        other = copy(self)
        other._set(parts)
        other.strange_s = strange_s
        return other

    def _set(self, parts: Sequence[Rest | Stretch]) -> None:
        sought = {
            id(part): self._sought.get(id(part)) or StretchTiming(part, self._bounds, self.meter)
            for part in parts
            if isinstance(part, Stretch) and not part.fixed
        }
        self._sought = sought
        self._parts: list[Piece | Stretch] = [
            part if isinstance(part, Rest) else sought.get(id(part), part) for part in parts
        ]
        self.recorded = parts
        self.pieces = [part for part in self._parts if not isinstance(part, Stretch)]
        self.seconds = sum(part.seconds for part in parts)

    def timed(self, change: Change, durations: Sequence[float]) -> tuple[Motion, Program | None]:
        """The motion at 1 kHz."""
        left = chain(self._rounded(durations))
        parts = []
        for part, recorded in zip(self._parts, self.recorded, strict=True):
            if isinstance(part, Stretch):
                parts.append(part.motion)
                continue
            seconds = next(left)
            if isinstance(part, Rest):
                parts.append(part.lasting(seconds, change.brakes_after))
            elif change.law and isinstance(part, StretchTiming):
                parts.append(part.motion(change.law, seconds))
            elif isinstance(recorded, Stretch):
                parts.append(recorded.motion)
        return joined(continuous(parts)), None

    def _rounded(self, durations: Sequence[float]) -> list[float]:
        """Durations in whole rows; the longest rest takes what rounding leaves, so that nothing is saved by it."""
        rows = [round(each * RATE) for each in durations]
        rests = [k for k, piece in enumerate(self.pieces) if isinstance(piece, Rest)]
        if rests:
            longest = max(rests, key=rows.__getitem__)
            rows[longest] = max(rows[longest] + round(sum(durations) * RATE) - sum(rows), 0)
        return [each / RATE for each in rows]
