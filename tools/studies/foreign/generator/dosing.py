"""How large an effect must be to reach a strength.

The strength is the RMS of the hidden power while the effect acts (above 5 % of its largest power), as a share of the
dynamic range of the metered power without it (p99 - p1), both within recordings.
"""

from __future__ import annotations

import numpy as np

from tools.studies.foreign.generator import meter
from tools.studies.foreign.generator.arm import Floats
from tools.studies.foreign.generator.hidden.effect import Dose, Hidden
from tools.studies.foreign.generator.plant import Session, flow

_TOLERANCE = 0.02
_STEPS = 8


def dosed(session: Session, effect: Hidden, strength: float) -> tuple[Dose, float]:
    """The dose, and the strength that it reaches (less than wanted where the size has a limit)."""
    clean, inside = flow(session, []).power, within(session)
    wanted = strength * float(np.ptp(np.percentile(clean[inside], [1, 99])))
    tried: list[tuple[float, float]] = []
    size = effect.start
    for _ in range(_STEPS):
        hidden = (flow(session, [Dose(effect, size)]).power - clean)[inside]
        reached = float(np.sqrt((hidden**2).mean())) if effect.everywhere else acting_rms(hidden)
        tried.append((size, reached))
        if abs(reached / wanted - 1) < _TOLERANCE or (size == effect.most and reached < wanted) or reached == 0.0:
            break
        size = min(size * (wanted / reached) ** (1 / _exponent(tried)), effect.most)
    size, reached = min(tried, key=lambda pair: abs(pair[1] - wanted))
    return Dose(effect, size), strength * reached / wanted


def _exponent(tried: list[tuple[float, float]]) -> float:
    """Of the power law through the last two sizes and RMS; 1 for a single one."""
    if len(tried) < 2 or tried[-1][0] == tried[-2][0]:
        return 1.0
    (size, rms), (last_size, last_rms) = tried[-1], tried[-2]
    return float(np.clip(np.log(rms / last_rms) / np.log(size / last_size), 0.3, 8.0))


def within(session: Session) -> Floats:
    """[W] whether a window of the meter lies within a recording."""
    mask = np.zeros(len(session.motion.t))
    for rows in session.motion.recordings:
        mask[rows] = 1.0
    return np.asarray(meter.windows(mask) > 0.5)


def acting_rms(hidden: Floats) -> float:
    """W, RMS where |hidden| [N] exceeds 5 % of its largest value."""
    largest = float(np.abs(hidden).max())
    if largest < 1e-9:
        return 0.0
    acting = np.abs(hidden) > 0.05 * largest
    return float(np.sqrt((hidden[acting] ** 2).mean()))
