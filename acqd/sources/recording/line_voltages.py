"""Star voltages from voltages between lines, where the currents allow it.

In a system without a current in the neutral conductor the power is that of any star point (Blondel's theorem), and the
one whose voltages add up to zero gives the power of the three wattmeters. With a neutral current the voltages of the
neutral are missing, and nothing can be converted.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError

_LOOP = 0.03
"""Largest RMS that the line voltages may leave around the loop, as a share of theirs: transformers and noise."""
_NEUTRAL = 0.03
"""Largest RMS of the sum of the currents, as a share of the largest current."""


def star_voltages(path: Path, pairs: list[tuple[int, ...]], volts: Floats, amperes: Floats) -> Floats:
    """[samples, 3] from the voltages [samples, pairs] from the first to the second line of each pair.

    `amperes` [samples, 3] are those of the lines. Raises InputError where the voltages contradict each other or the
    currents need a neutral conductor.
    """
    matrix = np.zeros((len(pairs), 3))
    for row, (begin, end) in enumerate(pairs):
        matrix[row, begin - 1], matrix[row, end - 1] = 1.0, -1.0
    star = volts @ np.linalg.pinv(matrix).T  # of all solutions the one whose sum is zero
    left = _rms(volts - star @ matrix.T).max()
    if left > _LOOP * _rms(volts).max():
        names = ", ".join(f"u{a}{b}" for a, b in pairs)
        raise InputError(
            path,
            f"its line voltages do not close the loop ({names} leave {100 * (left / _rms(volts).max()):.0f} %): a "
            "channel is of another phase or direction; say which with --map, u13 instead of u31 where it is reversed",
        )
    neutral = _rms(amperes.sum(axis=1, keepdims=True)).max()
    if neutral > _NEUTRAL * _rms(amperes).max():
        raise InputError(
            path,
            f"has voltages between lines, and currents whose sum is not zero ({neutral:.3g} A in the neutral): power "
            "needs the voltages to neutral; export those, or choose them with --map u1=...,i1=...",
        )
    return np.asarray(star)


def _rms(values: Floats) -> Floats:
    return np.asarray(np.sqrt((values * values).mean(axis=0)))
