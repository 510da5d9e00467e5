"""Which estimates of f are used, and what sets the length of the interval where none is."""

from __future__ import annotations

from collections import deque

import numpy as np

from acqd.arrays import Floats
from acqd.metering.bent import Bent
from acqd.metering.frequency import Estimate
from acqd.metering.onset import Cycles
from acqd.metering.packed import State
from acqd.metering.sideband import Sideband

_REMEMBERED = 15  # windows
_OFTEN = 5  # unsteady ones among them: an interharmonic rather than jumps


class HeldFrequency:
    """Continues f over windows without one.

    After a jump: the last f. While an interharmonic beats with the fundamental, f swings around the truth from window
    to window, also in those whose phase happens to be steady: the median of the last estimates, or what is left of f
    without the interharmonic where that is known.
    """

    def __init__(self, f_nominal: float, window_s: float) -> None:
        self.last = f_nominal
        """Hz."""
        self._sideband = Sideband(window_s)
        self._recent: deque[tuple[float, bool]] = deque(maxlen=_REMEMBERED)
        self._bent = Bent()

    @property
    def unsettled(self) -> bool:
        """Whether the f of the last window is in doubt.

        It may be moved by an interharmonic, and too few windows are known to tell; or f changes within the two cycles
        otherwise than by a ramp.
        """
        return self._bent.now or self._sideband.unsettled

    @property
    def calm(self) -> bool:
        """Steady estimates are usable: few of those remembered were unsteady, and no interharmonic is near f."""
        return not self._sideband.beating and sum(unsteady for _, unsteady in self._recent) < _OFTEN

    def note_steady(self, f: list[float], magnitude: list[float], cycles: list[Cycles]) -> list[bool]:
        """Estimates of consecutive windows that were all steady [Hz, digits]; `unsettled` of those that are usable."""
        unsettled: list[bool] = []
        while (done := len(unsettled)) < len(f):
            quiet = self._sideband.note_quiet(f[done:], magnitude[done:])
            if quiet:
                self._recent.extend((value, False) for value in f[done : done + quiet][-_REMEMBERED:])
                unsettled += [self._bent.note(one.kink, one.growth) for one in cycles[done : done + quiet]]
            elif self.note(f[done], magnitude[done], cycles[done]):
                unsettled.append(self.unsettled)
            else:
                break
        return unsettled

    def note_calm(self, f: float, magnitude: float, kink: float, growth: float) -> bool:
        """As `note`, for a window whose f is like those before; False, and nothing noted, for all others."""
        if not self._sideband.note_calm(f, magnitude):
            return False
        self._recent.append((f, False))
        self._bent.note(kink, growth)
        return True

    def note(self, f: float, magnitude: float, cycles: Cycles) -> bool:
        """The estimate of one window that was steady [Hz, digits]; whether it is usable."""
        if self._sideband.note(f, magnitude, cycles) is not None:
            self._sideband.forget_last()
            return False
        self._recent.append((f, False))
        self._bent.note(cycles.kink, cycles.growth)
        return True

    def state(self) -> State:
        """What is known of the stream so far."""
        recent = [[value, bool(bent)] for value, bent in self._recent]
        return {
            "last": self.last, "sideband": self._sideband.state(), "recent": recent,
            "bent": self._bent.state(),
        }  # fmt: skip

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self.last = state["last"]
        self._sideband.restore(state["sideband"])
        if "bent" in state:  # the state of an earlier acqd has no such key
            self._bent.restore(state["bent"])
        self._recent = deque(((value, bent) for value, bent in state["recent"]), maxlen=_REMEMBERED)

    def reset(self) -> None:
        """The next window does not follow the last one."""
        self._sideband.reset()

    def usable(self, estimate: Estimate) -> tuple[Floats, Floats, np.ndarray]:
        """f of consecutive windows, NaN where it is not known or not to be trusted; what f is about there; `unsettled`.

        The second is NaN where the last f goes on.
        """
        unsettled = np.zeros(len(estimate.f), dtype=bool)
        f, substitute = estimate.f.copy(), np.full(len(estimate.f), np.nan)
        seen = (f, estimate.unsteady, estimate.magnitude, estimate.bend, estimate.swell, estimate.kink, estimate.growth)
        columns = zip(*(column.tolist() for column in seen), strict=True)
        for k, (raw, unsteady, magnitude, *ends) in enumerate(columns):
            cycles = Cycles(*ends)
            if raw == raw:
                self._recent.append((raw, unsteady))
            without = self._sideband.note(raw, magnitude, cycles, steady=not unsteady)
            disturbed = sum(bent for _, bent in self._recent) >= _OFTEN
            if without is not None:
                substitute[k] = without
            elif disturbed:
                substitute[k] = np.median([value for value, _ in self._recent])
            if unsteady or disturbed or without is not None:
                f[k] = np.nan
            self._bent.note(cycles.kink, cycles.growth)
            unsettled[k] = self.unsettled and f[k] == f[k]
        return f, substitute, unsettled

    def fill(self, f: Floats, substitute: Floats) -> Floats:
        """`f` of the same windows, NaN replaced."""
        held = np.where(np.isnan(f), substitute, f)
        for k, value in enumerate(held.tolist()):
            if value == value:
                self.last = value
            held[k] = self.last
        return held
