"""Which estimates of f are used, and what sets the length of the interval where none is."""

from __future__ import annotations

from collections import deque

import numpy as np

from acqd.arrays import Floats
from acqd.metering.frequency import Estimate

_REMEMBERED = 15  # windows
_OFTEN = 5  # unsteady ones among them: an interharmonic rather than jumps


class HeldFrequency:
    """Continues f over windows without one.

    After a jump: the last f. While an interharmonic beats with the fundamental, f swings around the truth from window
    to window, also in those whose phase happens to be steady: the median of the last estimates.
    """

    def __init__(self, f_nominal: float) -> None:
        self.last = f_nominal
        """Hz."""
        self._recent: deque[tuple[float, bool]] = deque(maxlen=_REMEMBERED)

    @property
    def calm(self) -> bool:
        """Steady estimates are usable: few of those remembered were unsteady."""
        return sum(unsteady for _, unsteady in self._recent) < _OFTEN

    def note_steady(self, f: list[float]) -> None:
        """Estimates of consecutive windows that were all steady [Hz]."""
        self._recent.extend([(value, False) for value in f[-_REMEMBERED:]])

    def usable(self, estimate: Estimate) -> tuple[Floats, Floats]:
        """f of consecutive windows, NaN where it is not known or not to be trusted; and what f is about there.

        The second is NaN where the last f goes on.
        """
        f, substitute = estimate.f.copy(), np.full(len(estimate.f), np.nan)
        for k, (raw, unsteady) in enumerate(zip(f.tolist(), estimate.unsteady.tolist(), strict=True)):
            if raw == raw:
                self._recent.append((raw, unsteady))
            disturbed = sum(bent for _, bent in self._recent) >= _OFTEN
            if disturbed:
                substitute[k] = np.median([value for value, _ in self._recent])
            if unsteady or disturbed:
                f[k] = np.nan
        return f, substitute

    def fill(self, f: Floats, substitute: Floats) -> Floats:
        """`f` of the same windows, NaN replaced."""
        held = np.where(np.isnan(f), substitute, f)
        for k, value in enumerate(held.tolist()):
            if value == value:
                self.last = value
            held[k] = self.last
        return held
