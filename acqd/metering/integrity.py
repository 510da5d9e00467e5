"""Samples that are no measurements although they look like some: clipped, rolled over, shifted.

Each test asks for the shape that only the fault has, and not for a number that a load may reach: currents of
rectifiers, of phase control and of half waves are flat, jump and have a mean.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats

_LEVEL = 0.2
"""A flat top lies at least so far from zero, as a share of the peak: zero is where a load draws nothing."""
_FLAT = 4
"""Equal samples of a flat top."""
_APPROACH = 4
"""Samples before and after a flat top in which the wave moves evenly: an edge is faster."""
_TALL = 6.0
"""Slope at the end of a flat top times half of its samples, in quanta: of the rounded top of a parabola it is two."""
_WRAP = 0.8
"""Of the range: a step this large may be a roll-over."""
_OFFSET = 0.1
"""Mean of a voltage as a share of its alternating RMS."""


def clipped(x: Floats) -> bool:
    """Whether the samples of some cycles have flat tops that a smooth wave would exceed."""
    return _clipped_above(x, x.max()) or _clipped_above(-x, -x.min())


def _clipped_above(x: Floats, top: float) -> bool:
    peak = float(np.abs(x).max())
    if top < _LEVEL * peak or not peak:
        return False
    at = np.flatnonzero(x == top)
    if len(at) < _FLAT:
        return False
    steps = np.diff(x)
    moving = np.abs(steps[steps != 0])
    if not len(moving):
        return False
    quantum = float(moving.min())
    runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
    hits = 0
    for run in runs:
        first, last = int(run[0]), int(run[-1])
        if len(run) < _FLAT or first < _APPROACH or last + _APPROACH >= len(x):
            continue
        before, after = x[first - _APPROACH : first], x[last + _APPROACH : last : -1]
        hits += all(_runs_into(side, _TALL * quantum / (len(run) / 2)) for side in (before, after))
    return hits > 0


def _runs_into(side: Floats, least: float) -> bool:
    """Whether the samples rise evenly, by more than `least` each: a wave that has been cut, not an edge nor a top."""
    steps = np.diff(side)
    return bool(steps.min() > 0 and steps.max() < 4.5 * steps.min() and steps.mean() > least)


def rolled_over(x: Floats) -> bool:
    """Whether the wave leaves the range at one end and goes on at the other."""
    low, high = float(x.min()), float(x.max())
    span = high - low
    if not span or len(x) < 5:
        return False
    steps = np.diff(x)
    for at in np.flatnonzero(np.abs(steps) > _WRAP * span).tolist():
        if not 2 <= at < len(x) - 3:
            continue
        slopes = np.array([x[at] - x[at - 1], x[at - 1] - x[at - 2], x[at + 2] - x[at + 1], x[at + 3] - x[at + 2]])
        against = slopes * -np.sign(steps[at])
        if against.min() > 0.002 * span and against.max() < 4 * against.min():
            return True
    return False


def shifted(x: Floats) -> bool:
    """Whether the mean of a voltage over whole cycles is no mains voltage's: offset-binary codes, a lost zero."""
    spread = float(x.std())
    return bool(abs(float(x.mean())) > _OFFSET * spread and spread > 0)


def flags_of(values: Floats, cycle: int) -> frozenset[str]:
    """Flags of some whole cycles of `cycle` samples of U1, I1, U2, I2 ... [samples, channels], as codes or values."""
    found = set()
    for k in range(values.shape[1]):
        x = values[:, k]
        if rolled_over(x):
            found.add("rollover")
        elif clipped(x):
            found.add("clipped")
        if k % 2 == 0 and len(x) >= cycle and shifted(x[: len(x) // cycle * cycle]):
            found.add("offset")
    return frozenset(found)
