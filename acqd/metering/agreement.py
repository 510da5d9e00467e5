"""Whether f is what another fit of the same two cycles says, which sees what f does within them.

A step of f soon before the end of the two cycles hardly moves the fit over them (`trial`: its weight is 0 at the ends),
and most of the mean of f; f that swings within them moves it too little. The fit of a fast walk follows both, at two to
three times the noise. So f is in doubt where the two differ by more than noise makes them differ in this stream. Where
f swings or steps from window to window by more than any noise, a difference is no noise either.
"""

from __future__ import annotations

import math

from acqd.metering.packed import State

_LEAST = 0.008
"""Hz that the two may always differ by."""
_SWINGS, _LEAST_THEN = 0.15, 0.0035
"""Hz: second difference of the f of windows that is no noise, and what the two may differ by then."""
_LASTS = 3
"""Windows, for a swing has turning points."""
_MOST = 0.03
"""Hz: a change counts by no more towards the mean change."""
_CHANGES = 4.0
"""Mean changes of the difference that it may be: 4.5 standard deviations of white noise."""
_FEW = 25
"""Changes of which the mean is plain; later each one counts as among so many."""


class Agreement:
    """Of one stream."""

    def __init__(self) -> None:
        self._change = 0.0  # Hz: mean change of the difference from one window to the next
        self._known = 0
        self._last: float | None = None
        self._before: tuple[float, float] = (math.nan, math.nan)  # Hz: f of the last two windows
        self._swung = 0  # windows that still count as those of a swing
        self.doubted = False
        """Whether the f of the last window is in doubt."""

    def note(self, f: float, apart_Hz: float) -> bool:
        """`doubted`, of the next window of `f` [Hz], from which the third fit differs by `apart_Hz`; NaN: unknown."""
        first, second = self._before
        self._before = second, f
        self._swung = _LASTS if abs(f - 2 * second + first) > _SWINGS else max(self._swung - 1, 0)
        swings = self._swung > 0
        self.doubted = abs(apart_Hz) > (_LEAST_THEN if swings else max(_LEAST, _CHANGES * self._change))
        if apart_Hz != apart_Hz:
            self._last = None
            return False
        if self._last is not None and not swings:
            self._known = min(self._known + 1, _FEW)
            self._change += (min(abs(apart_Hz - self._last), _MOST) - self._change) / self._known
        self._last = apart_Hz
        return self.doubted

    def reset(self) -> None:
        """The next window does not follow the last one; what is noise stays."""
        self._last, self._before, self._swung = None, (math.nan, math.nan), 0

    def state(self) -> State:
        """What is known of the stream so far."""
        return {
            "change": self._change, "known": self._known, "last": self._last, "before": list(self._before),
            "swung": self._swung,
        }  # fmt: skip

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._change, self._known, self._last = state["change"], state["known"], state["last"]
        self._before, self._swung = tuple(state["before"]), state["swung"]
