"""Angles without jumps by whole turns: a counter that wraps at half a turn, or is reset."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats


def unwrapped(q: Floats, reach: Floats, turning: NDArray[np.bool_]) -> Floats:
    """Angles [T, axes] rad without jumps by whole turns.

    `reach` [T - 1, axes] rad: how far a joint can move between two rows; `turning` [axes]: revolute joints.
    A jump counts as turns only where what remains of it, and the two steps before and after, are possible motions:
    garbled angles jump as well.
    """
    jumps = np.diff(q, axis=0)
    turns = np.where(np.isfinite(jumps), np.rint(jumps / (2 * np.pi)), 0.0)
    rest = np.abs(jumps - 2 * np.pi * turns)
    possible = (rest <= reach) & (reach < np.pi)
    around = np.pad(possible, ((2, 2), (0, 0)), constant_values=True)
    calm = np.all([around[k : k + len(jumps)] for k in range(5)], axis=0)
    wraps = (turns != 0) & (np.abs(jumps) > reach) & calm & turning
    if not wraps.any():
        return q
    counted = np.concatenate([np.zeros((1, q.shape[1])), np.cumsum(np.where(wraps, turns, 0.0), axis=0)])
    return np.asarray(q - 2 * np.pi * counted)
