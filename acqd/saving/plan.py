"""Another timing of the same pieces: how long each of them lasts, and by which law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.motion.controller import Motion
from acqd.saving.cycle import Piece, Rest, Stretch, continuous, joined
from acqd.saving.power import Meter
from acqd.saving.sharing import Curve, shared
from acqd.saving.time_law import Bounds, Path

_FACTORS = (0.6, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 3.0)
"""Durations at which laws are sought, as shares of the old one."""


@dataclass(frozen=True, slots=True, eq=False)
class Timing:
    """Laws of one stretch for several durations."""

    path: Path
    laws: tuple[Floats, ...]
    """Of the points of the curve."""
    curve: Curve

    @classmethod
    def of(cls, stretch: Stretch, bounds: Bounds, meter: Meter) -> Timing:
        """Seek the laws of least energy."""
        path = Path(stretch.motion, bounds, meter.grey)
        found = {1.0: path.best(stretch.seconds, path.uniform)}
        middle = _FACTORS.index(1.0)
        for factors in (_FACTORS[middle + 1 :], _FACTORS[:middle][::-1]):
            law = found[1.0]
            for factor in factors:
                if law is not None:
                    found[factor] = law = path.best(factor * stretch.seconds, law)
        laws = {factor * stretch.seconds: law for factor, law in sorted(found.items()) if law is not None}
        curve = Curve.hull(np.array([*laws]), np.array([path.energy(law, s) for s, law in laws.items()]))
        every = list(laws.values())
        return cls(path, tuple(every[k] for k in curve.number), curve)

    @property
    def seconds(self) -> float:
        """The old duration."""
        return self.path.motion.seconds

    def motion(self, seconds: float, *, uniform: bool) -> Motion:
        """The stretch with a duration: by the law of the next shorter duration, slowed uniformly."""
        number = int(np.searchsorted(self.curve.seconds, seconds + 1e-9, side="right")) - 1
        return self.path.motion_at(self.path.uniform if uniform else self.laws[max(number, 0)], seconds)


@dataclass(frozen=True, slots=True)
class Change:
    """What a proposal may change."""

    laws: bool = False
    """The timing along the path."""
    waits: bool = False
    """Pauses may give time to motion, and take time from it."""
    slower: bool = False
    """All stretches by one factor."""
    brakes_after: float | None = None
    """s of standstill after which the brakes close."""


@dataclass(frozen=True, slots=True, eq=False)
class Cycle:
    """Pieces with the laws of their stretches."""

    pieces: Sequence[Piece]
    timings: Sequence[Timing | None]
    """Per piece; None for pauses and for stretches that stay as they are."""
    meter: Meter
    least_rest: float

    @classmethod
    def of(cls, pieces: Sequence[Piece], bounds: Bounds, meter: Meter, least_rest: float) -> Cycle:
        """Seek the laws of all stretches."""
        timings = [None if isinstance(each, Rest) or each.fixed else Timing.of(each, bounds, meter) for each in pieces]
        return cls(pieces, timings, meter, least_rest)

    @property
    def seconds(self) -> float:
        """Duration as it is."""
        return sum(piece.seconds for piece in self.pieces)

    def slack(self, piece: Rest) -> float:
        """What a pause can give, s."""
        return 0.0 if piece.process or piece.outer else max(piece.seconds - self.least_rest, 0.0)

    def durations(self, change: Change, total_s: float) -> list[float]:
        """Of every piece, s. Raises UserError where the cycle cannot be so fast."""
        if change.slower:
            return self._slowed(change, total_s)
        curves = []
        for piece, timing in zip(self.pieces, self.timings, strict=True):
            if isinstance(piece, Rest):
                power = 0.0 if change.brakes_after is not None else self.meter.holding(piece.position)
                give = self.slack(piece) if change.waits else 0.0
                flexible = change.waits and not (piece.process or piece.outer)
                curves.append(Curve.pause(piece.seconds - give, power) if flexible else _as_it_is(piece.seconds))
            elif timing is None or not change.laws:
                curves.append(_as_it_is(piece.seconds))
            else:
                curves.append(timing.curve)
        return shared(curves, total_s)

    def _slowed(self, change: Change, total_s: float) -> list[float]:
        """All stretches by one factor, and all pauses that can by another."""
        give = [self.slack(each) if isinstance(each, Rest) and change.waits else 0.0 for each in self.pieces]
        moving = sum(t.seconds for t in self.timings if t is not None)
        factor = (moving + sum(give) + total_s - self.seconds) / moving
        return [
            piece.seconds - given if timing is None else factor * timing.seconds
            for piece, timing, given in zip(self.pieces, self.timings, give, strict=True)
        ]

    def motion(self, change: Change, durations: Sequence[float]) -> Motion:
        """The whole cycle at 1 kHz."""
        parts = []
        for piece, timing, seconds in zip(self.pieces, self.timings, durations, strict=True):
            if isinstance(piece, Rest):
                parts.append(piece.lasting(seconds, change.brakes_after))
            elif timing is None or not (change.laws or change.slower):
                parts.append(piece.motion)
            else:
                parts.append(timing.motion(seconds, uniform=change.slower))
        return joined(continuous(parts))

    def changed_s(self, change: Change, durations: Sequence[float]) -> float:
        """Seconds of the old and the new cycle that differ."""
        total = 0.0
        for piece, timing, seconds in zip(self.pieces, self.timings, durations, strict=True):
            if timing is not None and (change.laws or change.slower):
                total += piece.seconds + seconds
            else:
                total += abs(piece.seconds - seconds)
        return total


def _as_it_is(seconds: float) -> Curve:
    return Curve(np.array([seconds]), np.zeros(1), np.zeros(1, int))
