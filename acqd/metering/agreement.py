"""Whether f is what another estimate of the same two cycles says, which sees what f does within them.

A step of f soon before the end of the two cycles hardly moves the fits over them, whose weights vanish at the ends, and
most of the mean of f; f that swings within them moves the fits too little. `walk` follows both, with more noise. What
the two differ by is therefore the error of f and noise: f is in doubt where they differ by more than is usual in this
stream. Where f itself steps or swings from window to window by more than any noise, a difference is no noise either.
"""

from __future__ import annotations

import math

from acqd.metering.packed import State

_LEAST = 0.008
"""Hz that the two may always differ by."""
_MOST = 0.02
"""Hz: beyond it f is in doubt, however usual that is."""
_TIMES_USUAL = 5.0
"""Mean differences that may occur: four standard deviations of white noise."""
_SWINGS, _LEAST_THEN = 0.15, 0.004
"""Hz: second difference of the f of windows that is no noise, and what the two may differ by then."""
_LASTS = 3
"""Windows, for a swing has turning points. A step of f has two or three such second differences, a swing goes on: no
estimate of two cycles follows it."""
_FEW = 25
"""Windows of which the mean difference is plain; later each one counts as among so many."""


class Agreement:
    """Of one stream."""

    def __init__(self) -> None:
        self._usual = 0.0  # Hz: mean difference of windows that were not in doubt
        self._known = 0
        self._before: tuple[float, float] = (math.nan, math.nan)  # Hz: f of the last two windows
        self._swung = 0  # windows that still count as those of a swing
        self._turns = 0  # second differences in it
        self.doubted = False
        """Whether the f of the last window is in doubt."""

    def note(self, f: float, apart_Hz: float) -> bool:
        """`doubted`, of the next window: the other estimate differs from `f` [Hz] by `apart_Hz`; NaN: unknown."""
        first, second = self._before
        self._before = second, f
        turns = abs(f - 2 * second + first) > _SWINGS
        self._swung = _LASTS if turns else max(self._swung - 1, 0)
        self._turns = self._turns + turns if self._swung else 0
        apart = abs(apart_Hz)
        limit = _LEAST_THEN if self._swung else min(max(_LEAST, _TIMES_USUAL * self._usual), _MOST)
        self.doubted = apart > limit or self._turns > _LASTS
        if apart <= _MOST and not self._swung:
            self._known = min(self._known + 1, _FEW)
            self._usual += (apart - self._usual) / self._known
        return self.doubted

    def reset(self) -> None:
        """The next window does not follow the last one; what is noise stays."""
        self._before, self._swung, self._turns = (math.nan, math.nan), 0, 0

    def state(self) -> State:
        """What is known of the stream so far."""
        return {
            "usual": self._usual, "known": self._known, "before": list(self._before), "swung": self._swung,
            "turns": self._turns,
        }  # fmt: skip

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._usual, self._known = state["usual"], state["known"]
        self._swung, self._turns = state["swung"], state["turns"]
        self._before = tuple(state["before"])
