"""Whether f changes shortly before the end of the two cycles of a window, which puts their f off.

A step of f there hardly moves the fit, and most of the mean of f. The phase leaves its parabola then (`trial`). Noise
and the loads of real mains bend it, too, and ln(magnitude) by as much: they set what is usual for the stream. A swing
of f bends the phase alone, in every window, by 2.5 times what f is off by: what is usual of the phase counts less.
"""

from __future__ import annotations

from acqd.metering.packed import State

_LEAST, _SWINGING = 0.007, 0.022
"""Hz of `Estimate.kink` that are doubted: of a step of f, which puts f off by 10 mHz where noise takes away 3; of a
swing of f that puts f off by 9 mHz, where the phase is bent all the time."""
_TIMES = 4.5
"""Usual ones: 3.6 standard deviations of white noise."""
_MOST = 0.05
"""Hz: more is no noise."""
_FEW, _MANY = 2, 25
"""Windows that an unknown stream has had already, of `_LEAST` each; later windows count as each among so many."""


class Bent:
    """Of one stream."""

    def __init__(self) -> None:
        self._usual = self._usual_growth = _LEAST  # Hz
        self._known = _FEW
        self.now = False
        """Whether the phase of the last window has a kink."""

    def note(self, kink: float, growth: float) -> bool:
        """`now`, of the next window [Hz]; NaN are those of a window without f."""
        swinging = min(_TIMES * self._usual, _SWINGING)
        self.now = kink > max(_LEAST, growth, swinging, _TIMES * self._usual_growth)
        if kink == kink:
            if self._known < _MANY:  # here and below `min`, without calls: this is done for every window
                self._known += 1
            self._usual += ((kink if kink < _MOST else _MOST) - self._usual) / self._known
            self._usual_growth += ((growth if growth < _MOST else _MOST) - self._usual_growth) / self._known
        return self.now

    def state(self) -> State:
        """What is known of the stream so far."""
        return {"usual": self._usual, "usual_growth": self._usual_growth, "known": self._known}

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        if "usual_growth" in state:  # else of an earlier acqd, whose usual bend was in rad
            self._usual, self._usual_growth, self._known = state["usual"], state["usual_growth"], state["known"]
