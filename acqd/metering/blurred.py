"""Flat tops that noise has blurred: a limit before the converter has cut the wave, and no two samples are equal.

How many samples lie near the extreme tells a cut wave from a smooth one. Beside the top of a smooth wave, which is a
power n of time, the number of samples within a band b grows as b^(1/n). All of a flat top lies within its noise, and
the flanks beside it move on. (The density of a sine at its extreme, as in the histogram test of IEEE 1241.)
"""

from __future__ import annotations

import math

import numpy as np

from acqd.arrays import Floats

_NOISE = 6.0
"""Standard deviations of white noise: nearly all samples of a flat top are within such a band."""
_SMOOTH = 1 / (2 ** (1 / 6) - 1)
"""Samples in the band per samples in the next one, of a top that is a sixth power; mains have second to fourth ones."""
_SAMPLES = 8
"""Of each flat top at least: of fewer, the times of the samples decide how many are in a band."""
_FLANKS = 0.08
"""Of the samples, between half of the top and the bands: a sine that is cut at 0.6 has 0.11 of them. Fewer are the
flanks of a block, as rectifiers draw it while their commutation lasts up to 28 degrees."""
_LOUD = 0.05
"""Of the top: in a wider band of noise, nothing can be told."""
_ORDER = 4
"""Differences of which order are noise: those of a wave are small."""


def blurred_tops(x: Floats) -> bool:
    """Whether one side of some whole cycles of a wave has been cut before noise was added."""
    differences = np.diff(x, _ORDER)
    noise = float(np.median(np.abs(differences))) / (0.6745 * math.sqrt(math.comb(2 * _ORDER, _ORDER)))
    levels = np.unique(x)
    if len(levels) < 2:
        return False
    band = max(_NOISE * noise, 2 * float(np.diff(levels).min()))
    return _is_cut(x, band) or _is_cut(-x, band)


def _is_cut(x: Floats, band: float) -> bool:
    top = float(x.max())
    if band > _LOUD * top:
        return False
    near, next_to, half = (int((x > limit).sum()) for limit in (top - band, top - 2 * band, top / 2))
    tops = int(np.count_nonzero(np.diff(x > top - 2 * band, prepend=False)) + 1) // 2
    return near >= _SAMPLES * tops and near > _SMOOTH * (next_to - near + 1) and half - next_to >= _FLANKS * len(x)
