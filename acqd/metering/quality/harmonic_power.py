"""Angles and active powers of the harmonics.

The active power of a harmonic has the sign of P: a negative one flows out of the load. The sign alone does not prove
which side is the source of a distortion where both sides distort.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.metering.quality.spectrum import ORDERS, Lines

_LEAST = 0.0005
"""Share of the fundamental below which a harmonic has no angle: the class A uncertainty of harmonics is 0.05 % of the
nominal voltage (IEC 61000-4-7, table 1, class I)."""
_PURE = 0.75
"""Share of a line in the squares of its subgroup; that of noise is a third, and its angle means nothing."""

_ORDERS, _NEIGHBOURS = np.arange(1, ORDERS + 1), np.array([-1, 0, 1])


def harmonic_powers(lines: Lines, cycles: int, known: int) -> tuple[Floats, Floats]:
    """Angles [deg; channels, 50] and active powers [W; phases, 50] of harmonics 1 .. 50 of U1, I1, U2 ...

    An angle is that of the harmonic's cosine where U1 of L1 has its maximum, between -180 and 180 degrees: the angle of
    the line less its order times that of U1. Both are of the line of the harmonic, as in IEEE 1459-2010, section 3.1.2,
    and not of the subgroup. NaN beyond `known` harmonics; angles also where the line is below 0.05 % of the
    fundamental or not most of its subgroup.
    """
    at = cycles * _ORDERS
    near = lines[:, at[:, None] + _NEIGHBOURS]
    squares = near.real * near.real + near.imag * near.imag
    line = squares[..., 1]
    clear = (line > _LEAST**2 * line[:, :1]) & (line >= _PURE * squares.sum(axis=-1))
    harmonics = near[..., 1]
    reference = harmonics[0, 0]
    turn = np.angle(reference) if abs(reference) > 0 else np.nan
    angles = np.angle(harmonics * np.exp(-1j * turn * _ORDERS), deg=True)
    angles[~clear] = np.nan
    powers = (harmonics[0::2] * harmonics[1::2].conj()).real
    angles[:, known:] = powers[:, known:] = np.nan
    return angles, powers
