"""An interharmonic beside the fundamental, told from a true swing of f.

An interharmonic of share a at f + b turns the fundamental's phasor into A (1 + a exp(j 2 pi b t)): its magnitude and
its phase swing together, a quarter of a beat apart. So w = ln(magnitude) + j phase has one line, at b. A true swing of
f moves the phase alone, a changing voltage the magnitude alone, and a step or a ramp of both at once is still a real
function times a complex number: all of these have lines of equal size at b and -b (single-sideband modulation). The
lines are fitted over the last windows together with a parabola, which takes the level, f and its rate of change.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.onset import UNKNOWN, Cycles, Onset
from acqd.metering.packed import State

LIMIT = 0.005
"""Hz; an interharmonic that moves f by less is let pass."""
SPREAD = 1.5 * LIMIT
"""Hz between the largest and the smallest f without which nothing is fitted."""
LENGTHS = (12, 25, 50)
"""Windows that are fitted: a fast beat is known early, a slow one at all."""
FASTEST = 0.45
"""Beats per window at most; half a beat is the limit of sampling."""
_SLOWEST = 0.8
"""Beats in the windows at least; fewer cannot be told from the parabola."""
_ONE_SIDED = 4.0
"""Power of the line over that of its mirror image."""
_JUMPS = 3
"""Windows with a bent phase that a phase jump makes; more among the first of the lengths are an interharmonic's."""
_EXPLAINED = 0.6
"""Share of what the parabola leaves that the line explains with its mirror image."""

Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class _Basis:
    parabola: Floats
    """[3, n] orthonormal."""
    lines: Complexes
    """[beats, 2, n] orthonormal pairs, conjugated: what a line and its mirror image add to the parabola."""
    solve: Complexes
    """[beats, 5, n] pseudo-inverses: parabola in windows from the last one, line, mirror image."""
    beats: Floats
    """[beats] per window."""


class Sideband:
    """Remembers the fundamental of the last windows of a stream; looks at stretches of `lengths` windows."""

    def __init__(self, window_s: float, lengths: Sequence[int] = LENGTHS) -> None:
        self._window_s, self._lengths = window_s, lengths
        self._f: deque[float] = deque(maxlen=lengths[-1])
        self._magnitude: deque[float] = deque(maxlen=lengths[-1])
        self._bent: deque[bool] = deque(maxlen=lengths[0])
        self._low = self._high = 0.0  # bounds of the remembered f and of some before them
        self._left = 0  # windows until these are forgotten
        self._next = 0  # which of the lengths has its turn
        self._suspected = False
        self.beating = False
        """Whether an interharmonic moved f in the last window."""
        self._lost = False  # it did in the window before, and cannot be found in the last one
        self._onset = Onset(SPREAD, lengths[-1], FASTEST / window_s, edge=2, known=lengths[0])

    @property
    def unsettled(self) -> bool:
        """Whether f has begun to vary, and too few windows are known to tell an interharmonic from a swing of f; or an
        interharmonic that moved f cannot be found any more: nobody knows yet whether it has ended.
        """
        return self._onset.doubted or self._lost

    def state(self) -> State:
        """What is known of the stream so far."""
        return {
            "f": list(self._f), "magnitude": list(self._magnitude), "bent": list(self._bent),
            "bounds": [self._low, self._high, self._left], "next": self._next,
            "suspected": self._suspected, "beating": self.beating, "onset": self._onset.state(),
        }  # fmt: skip

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        for name, values in (("f", self._f), ("magnitude", self._magnitude), ("bent", self._bent)):
            values.clear()
            values.extend(state[name])
        self._low, self._high, self._left = state["bounds"]
        self._next, self._suspected, self.beating = state["next"], state["suspected"], state["beating"]
        self._onset.restore(state["onset"])

    def reset(self) -> None:
        """The next window does not follow the last one."""
        self._f.clear()
        self._magnitude.clear()
        self._bent.clear()
        self._left = 0
        self.beating = self._suspected = False
        self._onset.reset()

    def note(self, f: float, magnitude: float, cycles: Cycles = UNKNOWN, *, steady: bool = True) -> float | None:
        """The next window: f [Hz] as it was estimated, magnitude of the fundamental in any unit, what its cycles say.

        About the f without the interharmonic, where one moves it; else None. A window that is not `steady` counts as
        the one before, as long as a phase jump may be the reason. A window without f ends what is remembered.
        """
        was, self._lost = self.beating, False
        if f != f or not magnitude > 0:
            self.reset()
            return None
        self._bent.append(not steady)
        if not steady and sum(self._bent) <= _JUMPS:
            if not self._f:
                return None  # nothing is known yet: f of a jump says nothing
            f, magnitude = self._f[-1], self._magnitude[-1]
        self._f.append(f)
        self._magnitude.append(magnitude)
        forgotten = self._bound(f)
        spread = self._high - self._low
        varies = spread >= SPREAD
        if varies or forgotten:
            self._onset.note(spread, self._f, self._magnitude, cycles, explained=self.beating)
        if not varies or len(self._f) < self._lengths[0]:
            self.beating = self._suspected = False
            return None
        # One length per window while there is nothing; then all of them, the longest, and most exact, first.
        self._next = (self._next + 1) % len(self._lengths)
        found = self._look(self._lengths[::-1] if self._suspected else self._lengths[self._next : self._next + 1])
        self.beating = found is not None and self._suspected  # a chance likeness does not last
        self._suspected = found is not None
        self._lost = was and not self.beating
        return found if self.beating else None

    def note_quiet(self, f: Sequence[float], magnitude: Sequence[float]) -> int:
        """Takes some of the next windows at once, all steady, if f does not vary in them; how many it has taken."""
        count = min(self._left, len(f))
        if not count:
            return 0
        f, magnitude = f[:count], magnitude[:count]
        low, high = min(self._low, min(f)), max(self._high, max(f))
        if high - low >= SPREAD:
            return 0
        self._low, self._high, self._left = low, high, self._left - count
        self._f.extend(f)
        self._magnitude.extend(magnitude)
        self._bent.extend([False] * count)
        return count

    def note_calm(self, f: float, magnitude: float) -> bool:
        """`note_quiet` of a single window, as all are while a stream runs; whether it has been taken."""
        low, high = self._low, self._high
        if f < low:
            low = f
        elif f > high:
            high = f
        if not self._left or high - low >= SPREAD:
            return False
        self._low, self._high = low, high
        self._left -= 1
        self._f.append(f)
        self._magnitude.append(magnitude)
        self._bent.append(False)
        return True

    def note_all(self, f: Sequence[float], magnitude: Sequence[float]) -> bool:
        """The next windows at once, all steady: whether an interharmonic moves f in the last one.

        Here one likeness is enough: the windows are cycles, and a call has ten of them.
        """
        self._f.extend(f)
        self._magnitude.extend(magnitude)
        self.beating = max(self._f) - min(self._f) >= SPREAD and self._look(self._lengths) is not None
        return self.beating

    def forget_last(self) -> None:
        """The last window will be noted again."""
        self._f.pop()
        self._magnitude.pop()
        self._bent.pop()

    def _bound(self, f: float) -> bool:
        """Of the remembered f, the last of which is `f`; every lengths[0] windows of these alone, and True."""
        if self._left:
            self._left -= 1
            self._low, self._high = min(self._low, f), max(self._high, f)
            return False
        self._low, self._high, self._left = min(self._f), max(self._f), self._lengths[0]
        return True

    def _look(self, lengths: Sequence[int]) -> float | None:
        """f [Hz] without the interharmonic, from the first of `lengths` that shows one; None where none does."""
        f, magnitude = np.array(self._f), np.array(self._magnitude)
        turn = 2 * np.pi * self._window_s
        phase = turn * (np.cumsum(f - f[-1]) - 0.5 * (f - f[-1]))  # in the middles of the windows, less that of f[-1]
        w = np.log(magnitude / magnitude[-1]) + 1j * phase
        for length in lengths:
            if length <= len(w) and np.ptp(f[-length:]) >= SPREAD:
                slope = self._slope(w[-length:])
                if slope is not None:
                    # Over the shortest length a parabola and a slow line are much alike: the mean is more exact.
                    return float(f[-1] + slope / turn) if length > self._lengths[0] else float(f[-length:].mean())
        return None

    def _slope(self, w: Complexes) -> float | None:
        """Slope of the phase [rad/window] at the last window without the line; None where there is none."""
        basis = _basis(len(w))
        rest = w - (basis.parabola @ w) @ basis.parabola
        explained = np.square(np.abs(basis.lines @ rest)).sum(axis=1)
        best = int(np.argmax(explained))
        if explained[best] < _EXPLAINED * float(np.square(np.abs(rest)).sum()):
            return None
        _, slope, _, line, mirror = basis.solve[best] @ w
        larger, smaller = max(abs(line), abs(mirror)), min(abs(line), abs(mirror))
        if larger**2 < _ONE_SIDED * smaller**2 or larger * basis.beats[best] / self._window_s < LIMIT:
            return None
        return float(slope.imag)


@lru_cache(maxsize=8)
def _basis(n: int) -> _Basis:
    t = np.arange(n) - (n - 1.0)
    beats = np.arange(_SLOWEST / n, FASTEST, 0.2 / n)
    powers = t[:, None] ** np.arange(3)
    parabola, _ = np.linalg.qr(powers)
    lines, solve = [], []
    for beat in beats:
        pair = np.exp(2j * np.pi * beat * np.outer(t, [1, -1]))
        orthonormal, _ = np.linalg.qr(pair - parabola @ (parabola.T @ pair))
        lines.append(orthonormal.conj().T)
        solve.append(np.linalg.pinv(np.hstack((powers, pair))))
    return _Basis(np.ascontiguousarray(parabola.T), np.array(lines), np.array(solve), beats)
