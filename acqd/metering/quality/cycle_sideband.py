"""An interharmonic beside f, from the phasors of consecutive cycles (`metering.sideband`)."""

from __future__ import annotations

import cmath
import math
from collections import deque
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from acqd.metering.onset import Onset
from acqd.metering.quality.cycles import CycleFit
from acqd.metering.sideband import FASTEST, LENGTHS, SPREAD, Sideband

_INTERVALS = 10
"""2 s, after which every interharmonic that moves f by 10 mHz is known."""


class CycleSideband:
    """Remembers the cycles of the intervals of a chain; an interval begins where the last one ended."""

    def __init__(self, f_nominal: float) -> None:
        self._sideband = Sideband(1 / f_nominal, (*LENGTHS, 2 * LENGTHS[-1]))
        self._last: NDArray[np.complex128] | None = None  # [phases]
        self._last_power = 0.0
        self._f: deque[float] = deque(maxlen=_INTERVALS)
        self._magnitude: deque[float] = deque(maxlen=_INTERVALS)
        self._onset = Onset(SPREAD, _INTERVALS, FASTEST * f_nominal / 10)

    @property
    def unsettled(self) -> bool:
        """Whether the f of intervals has begun to vary, and an interharmonic cannot be told from a swing of f yet."""
        return self._onset.doubted

    def moves(self, fit: CycleFit, *, follows: bool) -> bool:
        """Whether an interharmonic moves the f of the interval; `follows`: without a gap or a tick before it."""
        phasors = fit.phasors
        jumps = fit.jump != 0 and not self._sideband.beating  # a beat may look like a jump
        if not follows or phasors is None or jumps:
            self._sideband.reset()
            self._last = None
            self._onset.reset()
        if phasors is None:
            self._f.clear()
            self._magnitude.clear()
        if phasors is None or jumps:
            return False
        # To the phases that cycles of the interval's own f have: it ends where the next one begins.
        turn = 2 * math.pi * (fit.trial / fit.f - 1)
        turns = (np.diff(fit.phases) + turn).tolist()
        power = (phasors.real * phasors.real + phasors.imag * phasors.imag).sum(axis=0).tolist()
        if self._last is not None:
            between = complex(np.vdot(self._last, phasors[:, 0])) * cmath.rect(1.0, turn / 2)
            turns.insert(0, cmath.phase(between))
            power.insert(0, self._last_power)
        self._last = phasors[:, -1] * cmath.rect(1.0, turn * (phasors.shape[1] - 0.5))
        self._last_power = power[-1]
        f = [fit.f * (1 + each / (2 * math.pi)) for each in turns]
        magnitude = [math.sqrt((one + other) / 2) for one, other in pairwise(power)]
        self._f.append(fit.f)
        self._magnitude.append(sum(magnitude) / len(magnitude))
        moved = self._sideband.note_all(f, magnitude)
        self._onset.note(max(self._f) - min(self._f), self._f, self._magnitude, explained=moved)
        return moved
