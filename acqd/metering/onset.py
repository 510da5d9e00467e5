"""Whether f has begun to vary more than it used to, so that nobody can tell yet what moves it.

An interharmonic that sets in moves f before it is known (`sideband`), and a true swing of f looks the same. The f of
noisy mains always varies a little: only more than that is an onset.

An interharmonic moves f around the truth, so the truth lies among the f that are remembered, or is the f from before.
An f that is near both is right, whatever the reason.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Collection
from typing import NamedTuple

from acqd.metering.packed import State

_MORE = 1.25
"""A spread so many times the largest one of late is an onset."""
_REMEMBERED = 0.9992
"""Share of that largest spread after a note: half is forgotten within minutes."""
_MARGIN = 4.0
"""Of the limit for how much f varies with the magnitude, which holds for pure lines."""
_MOVED = 100.0
"""Hz per rad of `Cycles`: an interharmonic that begins moves f by so much at most."""
_CALM = 0.0006
"""rad, of bend of `Cycles`: a step of f within the window bends the phase by more where it puts f off by 10 mHz."""
_BEATING = 0.0005
"""Of bend and swell of `Cycles`: an interharmonic far from f has both, a ramp or a swing of f and a step of the voltage
only one. So much swell has one that begins, too, where it moves f by 10 mHz."""
_WRONG = 0.010
"""Hz: an f that is off by less is right (IEC 61000-4-30 class A)."""
_NEAR = 0.008
"""Hz from the f before: 2 mHz less, since the true f may have changed by so much since."""
_SWELLING = 0.002
"""Of swell: so much is an interharmonic's, whatever the bend; it beats slowly."""
_ALIKE = 0.4
"""Share of the variance of f that a straight line through the magnitude explains beside an interharmonic. Noise and
swings of f leave that share near 0."""
_CHANCE = 0.01
"""Probability of at least that share in noise; the fewer values, the larger the share."""


class Cycles(NamedTuple):
    """What the cycles of a window say (`frequency.Estimate`); NaN where nobody knows."""

    bend: float
    """rad."""
    swell: float
    """Of ln(magnitude)."""
    kink: float
    """Hz."""
    growth: float
    """Hz."""

    @property
    def beat(self) -> bool:
        """Whether they do what they do beside an interharmonic."""
        return min(self.bend, self.swell) > _BEATING or self.swell > _SWELLING


UNKNOWN = Cycles(*[math.nan] * 4)


class Onset:
    """Of one stream."""

    def __init__(self, least_Hz: float, windows: int, fastest_Hz: float, edge: int = 0, known: int = 0) -> None:
        """A spread of f below `least_Hz` is none; after so many windows it is usual; `fastest_Hz`: of a beat.

        `edge`: windows in which an interharmonic may begin; it moves their f by more than that of later ones.
        `known`: windows that show what f is beside an interharmonic, or was before it; 0: nothing shows that.
        """
        self._least_Hz, self._windows, self._fastest_Hz, self._edge = least_Hz, windows, fastest_Hz, edge
        self._known = known
        self._limit_Hz = least_Hz
        self._varied = 0
        self.doubted = False
        """Whether f varies unusually, and has for less than the windows."""

    def reset(self) -> None:
        """The next windows do not follow the last ones; what is usual stays."""
        self._varied, self.doubted = 0, False

    def state(self) -> State:
        """What is known of the stream so far."""
        return {"limit_Hz": self._limit_Hz, "varied": self._varied, "doubted": self.doubted}

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._limit_Hz, self._varied, self.doubted = state["limit_Hz"], state["varied"], state["doubted"]

    def note(
        self, spread_Hz: float, f: Collection[float], magnitude: Collection[float], cycles: Cycles = UNKNOWN, *,
        explained: bool,
    ) -> None:  # fmt: skip
        """One more window: how much the remembered f vary, and whether a known interharmonic is why."""
        if explained:
            self._varied, self.doubted = self._edge, False  # it has begun long ago
        elif spread_Hz < self._limit_Hz:
            self.reset()
            self._limit_Hz = max(self._least_Hz, _MORE * spread_Hz, self._limit_Hz * _REMEMBERED)
        else:
            self._varied += 1
            few, edge = self._varied < self._windows, self._varied <= self._edge
            if edge:
                swerve = max(cycles.bend, cycles.swell)
                calm = cycles.bend < _CALM and cycles.swell < _BEATING
                self.doubted = not (calm and spread_Hz > _MOVED * swerve)
            else:
                self.doubted = few and (cycles.beat or self._movable(f, magnitude))
            self.doubted = self.doubted and not self._right(list(f))
            if self._varied >= self._windows:
                self._limit_Hz = _MORE * spread_Hz

    def _right(self, f: list[float]) -> bool:
        """Whether the last f [Hz] is right even where an interharmonic moves it."""
        if not self._known or len(f) < self._known:
            return False
        last, before = f[-1], f[: len(f) - self._varied]
        among_all = max(max(f) - last, last - min(f)) < _WRONG
        return among_all or (len(before) >= self._known and abs(last - statistics.median(before)) < _NEAR)

    def _movable(self, f: Collection[float], magnitude: Collection[float]) -> bool:
        """Whether an interharmonic may be why these f [Hz] differ, by how much their magnitudes do, and when.

        ln(magnitude) varies by a cos(2 pi b t), and f by b times that: by at most the fastest beat times what
        ln(magnitude) does, and with it.
        """
        if max(f) - min(f) >= _MARGIN * self._fastest_Hz * math.log(max(magnitude) / min(magnitude)):
            return False
        begun = len(f) - self._varied
        pairs = [
            (one, math.log(other))
            for k, (one, other) in enumerate(zip(f, magnitude, strict=True))
            if not begun <= k < begun + self._edge  # of both sides of the onset: they need not be alike
        ]
        if len(pairs) < 4:
            return True
        needed = max(_ALIKE, 1 - _CHANCE ** (2 / (len(pairs) - 2)))
        return bool(statistics.correlation(*zip(*pairs, strict=True)) ** 2 >= needed)
