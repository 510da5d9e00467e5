"""Rows at the ends of a motion whose accelerations nobody knows: a log may begin and end while the arm moves.

An acceleration is a difference of the rows before and after. At the first and the last row of a log one of them is
missing, and no polynomial replaces it: its order trades the jerk of the motion for the noise of the encoder. Where the
arm moves there, such rows say how it moves, but their power belongs to an acceleration that is not known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.numerics import runs_of_true

ROWS = 1
"""Rows at an end whose acceleration is not known. The next row has neighbours on both sides."""
_RESTS = 0.025
"""rad/s or m/s up to which an arm rests at an end."""
_LEAST_ROWS = 20 * ROWS
"""Rows of a shorter motion are all used: it cannot do without its ends."""


def unknown_ends(q: Floats, known: NDArray[np.bool_], step_s: float) -> NDArray[np.bool_]:
    """[T] rows at the ends of runs of `known` [T] rows of angles [T, axes] where the arm moves."""
    unknown = np.zeros(len(q), bool)
    for start, end in runs_of_true(known):
        if end - start < _LEAST_ROWS:
            continue
        first, last = (np.abs(np.diff(q[rows : rows + 2], axis=0)).max() for rows in (start, end - 2))
        if first > _RESTS * step_s:
            unknown[start : start + ROWS] = True
        if last > _RESTS * step_s:
            unknown[end - ROWS : end] = True
    return unknown


def sentence(rows: int, step_s: float) -> str:
    """What a user should know of so many rows; empty for 0."""
    if not rows:
        return ""
    counted, verb = ("1 row", "is") if rows == 1 else (f"{rows} rows", "are")
    return (
        f"{counted} of {1000 * step_s:.0f} ms at its ends {verb} in motion: accelerations are not known there, and "
        "power is not used"
    )
