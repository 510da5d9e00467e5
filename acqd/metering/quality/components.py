"""Symmetrical components of three phasors (Fortescue 1918), unbalance and the order of the phases."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_A = np.exp(2j * np.pi / 3)
_FORTESCUE = np.array([[1, 1, 1], [1, _A, _A**2], [1, _A**2, _A]]) / 3

Phasors = NDArray[np.complex128]


def symmetrical(phasors: Phasors) -> Phasors:
    """Zero, positive and negative sequence [3, ...] of the phasors of L1, L2, L3 [3, ...].

    F x / 3 with a = exp(j 120 deg).
    """
    return np.asarray(_FORTESCUE @ phasors)


def unbalance(phasors: Phasors) -> tuple[float, float]:
    """u2 = |U_neg| / |U_pos| and u0 = |U_zero| / |U_pos| in % (IEC 61000-4-30, section 5.7); NaN without |U_pos|.

    Where the phases turn the other way round, numerator and denominator change places: the sequence that the system
    has is the one it is compared with.
    """
    return unbalance_of(np.abs(symmetrical(phasors)).tolist())


def unbalance_of(sequences: Sequence[float]) -> tuple[float, float]:
    """The same of the magnitudes of zero, positive and negative sequence."""
    zero, positive, negative = sequences
    main, other = max(positive, negative), min(positive, negative)
    return (100 * other / main, 100 * zero / main) if main > 0 else (math.nan, math.nan)


def rotation(sequences: Sequence[float]) -> float:
    """1: L1-L2-L3. -1: L1-L3-L2. NaN where it is not clear: neither sequence is twice the other one.

    Of the magnitudes of zero, positive and negative sequence.
    """
    _, positive, negative = sequences
    if max(positive, negative) <= 2 * min(positive, negative) or not max(positive, negative) > 0:
        return math.nan
    return 1.0 if positive > negative else -1.0
