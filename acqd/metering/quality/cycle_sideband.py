"""An interharmonic beside f, from the phasors of consecutive cycles (`metering.sideband`)."""

from __future__ import annotations

from collections import deque

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
        middles = np.arange(phasors.shape[1]) + 0.5
        phasors = phasors * np.exp(2j * np.pi * (fit.trial / fit.f - 1) * middles)
        if self._last is not None:
            phasors = np.concatenate((self._last[:, None], phasors), axis=1)
        self._last = phasors[:, -1]
        turned = (phasors[:, :-1].conj() * phasors[:, 1:]).sum(axis=0)
        turns = np.arctan2(turned.imag, turned.real)
        power = (phasors.real * phasors.real + phasors.imag * phasors.imag).sum(axis=0)
        f = fit.f * (1 + turns / (2 * np.pi))
        magnitude = np.sqrt((power[:-1] + power[1:]) / 2)
        self._f.append(fit.f)
        self._magnitude.append(float(magnitude.mean()))
        moved = self._sideband.note_all(f.tolist(), magnitude.tolist())
        self._onset.note(max(self._f) - min(self._f), self._f, self._magnitude, explained=moved)
        return moved
