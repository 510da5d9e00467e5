"""Whether the phase within a window is bent as by a step of f, which puts the f of the window off.

A step of f soon before the end of the two cycles hardly moves the f of their fit, and most of the mean of f. Samples
after the cycles show such a step twice as plainly, but real mains bend the phase by nearly as much all the time: where
there are such samples, the smaller limit follows what is usual for the stream.
"""

from __future__ import annotations

from acqd.metering.packed import State

_SURE = 0.001
"""rad of `Estimate.bend`: steps of f that put a window off by 10 mHz bend the phase by so much, mains hardly ever."""
_LEAST = 0.0005
"""rad: the same where samples of a quarter of a cycle or more follow the two cycles."""
_TIMES_USUAL = 4.0
_FEW = 25
"""Windows of which the usual bend is the mean; later each one counts as among so many."""
_FOLLOWED = 2.5
"""Cycles of a window that has a quarter of a cycle before and after its two."""


class Bent:
    """Of one stream."""

    def __init__(self, cycles: float) -> None:
        """`cycles`: nominal cycles of a window, of which two are metered."""
        self._least = _LEAST if cycles >= _FOLLOWED else _SURE
        self._usual = _SURE  # rad; of an unknown stream
        self._known = 0
        self.now = False
        """Whether the last window is bent."""

    def note(self, bend: float) -> bool:
        """`now`, of the next window; a bend of inf or NaN is that of a window without f."""
        self.now = bend > min(max(self._least, _TIMES_USUAL * self._usual), _SURE)
        if bend < _SURE:
            self._known = min(self._known + 1, _FEW)
            self._usual += (bend - self._usual) / self._known
        return self.now

    def state(self) -> State:
        """What is known of the stream so far."""
        return {"usual": self._usual, "known": self._known}

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._usual, self._known = state["usual"], state["known"]
