"""Steps of the numpy path of the meter: physical channels, their products, and the whole cycles of a window."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes

CYCLES = 2
"""Mains cycles per synchronous value."""


def synchronous(starts: np.ndarray, ends: np.ndarray, length: Floats) -> tuple[Floats, Floats, np.ndarray]:
    """Bounds of the whole cycles to meter in each window, and which windows meter only half as many.

    The cycles lie in the middle of the window when they fit, which keeps their lag constant whatever
    f is; otherwise they end with the window and reach back into the history. At a stream's start the
    history may be too short: then one cycle is metered.
    """
    room = (ends - starts) - length
    start = np.where(room >= 0, starts + room / 2, ends - length)
    short = start < 0
    half = np.where(short, length / CYCLES, length)
    start = np.where(short, ends - half, start)
    return start, np.minimum(start + half, ends), short


def channels(codes: Codes) -> tuple[Floats, Floats]:
    """Voltages and currents [phases, samples] in digits, as doubles."""
    u = np.ascontiguousarray(codes[:, 0::2].T, dtype=np.float64)
    i = np.ascontiguousarray(codes[:, 1::2].T, dtype=np.float64)
    return u, i


def products_of(u: Floats, i: Floats) -> Floats:
    """u*u, i*i, u*i stacked, [3, phases, samples]; sums of them are exact integers."""
    products = np.empty((3, *u.shape))
    np.multiply(u, u, out=products[0])
    np.multiply(i, i, out=products[1])
    np.multiply(u, i, out=products[2])
    return products
