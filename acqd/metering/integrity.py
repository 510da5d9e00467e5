"""Samples that are no measurements although they look like some: clipped, rolled over, shifted, saturated.

Each test asks for the shape that only the fault has, and not for a number that a load may reach: currents of
rectifiers, of phase control and of half waves are flat, jump and have a mean.
"""

from __future__ import annotations

import math

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes
from acqd.metering.look import Look, look_at

_LEVEL = 0.2
"""A flat top lies at least so far from zero, as a share of the peak: zero is where a load draws nothing."""
_FLAT = 4
"""Equal samples of a flat top."""
_PAUSE = 0.4
"""Of a cycle: a longer flat is the pause of a half-wave load behind a transformer, which passes no mean."""
_APPROACH = 4
"""Samples before and after a flat top in which the wave moves evenly: an edge is faster."""
_TALL = 6.0
"""Slope beside a flat top, relative to the quantum that a rounded top leaves flat: of a parabola it is two, and noise
of a quantum doubles that."""
_WRAP = 0.8
"""Of the range: a step this large may be a roll-over."""
_SLOPES = 400
"""Of a cycle: slopes beside a roll-over are those of such a part of it, at least of one sample."""
_OFFSET = 0.1
"""Mean of a voltage as a share of its alternating RMS."""

_EVEN, _MEAN = 0.06, 0.08
"""Of the fundamental: second harmonic of a saturated current transformer at least, and its mean at most."""
_UNEVEN = 0.04
"""Sum of samples half a cycle apart, as a share of the samples: what 3 % of a second harmonic make."""
_SHORT = 40
"""Part of a cycle in which a saturated current collapses."""
_COLLAPSE, _REST = 0.35, 0.2
"""Of the peak: what a collapse loses, and what is left after it."""
_FASTER = 2.0
"""Times the fastest rise: a collapse. Loads that switch on jump as fast as those that switch off."""


def clipped(x: Floats, cycle: int) -> bool:
    """Whether the samples of some cycles of `cycle` samples have flat tops that a smooth wave would exceed."""
    return _clipped_above(x, x.max(), cycle) or _clipped_above(-x, -x.min(), cycle)


def _clipped_above(x: Floats, top: float, cycle: int) -> bool:
    peak = float(np.abs(x).max())
    if top < _LEVEL * peak or not peak:
        return False
    at = np.flatnonzero(x == top)
    if len(at) < _FLAT:
        return False
    levels = np.unique(x)
    if len(levels) < 2:
        return False
    quantum = float(np.diff(levels).min())
    runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
    hits = 0
    for run in runs:
        first, last = int(run[0]), int(run[-1])
        if not _FLAT <= len(run) <= _PAUSE * cycle or first < _APPROACH or last + _APPROACH >= len(x):
            continue
        before, after = x[first - _APPROACH : first], x[last + _APPROACH : last : -1]
        half = len(run) / 2
        rounded = quantum * (half + _APPROACH / 2) / half**2  # a parabola is as steep as twice that, beside its top
        hits += all(_runs_into(side, _TALL * rounded) for side in (before, after))
    return hits > 0


def _runs_into(side: Floats, least: float) -> bool:
    """Whether the samples rise evenly, by more than `least` each: a wave that has been cut, not an edge nor a top."""
    steps = np.diff(side)
    return bool(steps.min() > 0 and steps.max() < 4.5 * steps.min() and steps.mean() > least)


def rolled_over(x: Floats, cycle: int) -> bool:
    """Whether the wave leaves the range at one end and goes on at the other; `cycle`: samples of one."""
    low, high = float(x.min()), float(x.max())
    span = high - low
    if not span or len(x) < 5:
        return False
    steps, apart = np.diff(x), max(1, cycle // _SLOPES)
    for at in np.flatnonzero(np.abs(steps) > _WRAP * span).tolist():
        if not 2 * apart <= at < len(x) - 1 - 2 * apart:
            continue
        before, after = x[at - 2 * apart : at + 1 : apart], x[at + 1 : at + 2 + 2 * apart : apart]
        slopes = np.concatenate((np.diff(before), np.diff(after)))
        against = slopes * -np.sign(steps[at])
        if against.min() > 0.002 * span and against.max() < 4 * against.min():
            return True
    return False


def shifted(x: Floats) -> bool:
    """Whether the mean of a voltage over whole cycles is no mains voltage's: offset-binary codes, a lost zero."""
    spread = float(x.std())
    return bool(abs(float(x.mean())) > _OFFSET * spread and spread > 0)


def saturated(x: Floats, cycle: int) -> bool:
    """Whether whole cycles of `cycle` samples of a current are those of a transformer with a saturated core.

    The secondary follows the primary until the flux, the integral of the secondary, reaches the knee of the magnetising
    curve; then it collapses until the primary changes its sign. No transformer passes a mean, so a mean of the primary
    saturates one half of the cycle: even harmonics without a mean. Half waves and phase control, measured by sensors
    that pass a mean, have one; what blocks it lifts their pauses off zero. (IEEE C37.110, annex C.)
    """
    size = len(x) // cycle * cycle
    if cycle < 2 * _SHORT // 5 or not size:
        return False
    x = x[:size]
    turn = np.exp(-2j * np.pi / cycle * np.arange(size))
    first, second = (2 * abs((wave * x).sum()) / size for wave in (turn, turn * turn))
    if not first or second < _EVEN * first or abs(float(x.mean())) > _MEAN * first:
        return False
    peak, short = float(np.abs(x).max()), max(1, cycle // _SHORT)
    change = np.abs(x[short:]) - np.abs(x[:-short])
    change[x[short:] * x[:-short] < 0] = 0.0  # through zero: neither a rise nor a collapse
    falls = [float(-change[at : at + cycle].min(initial=0.0)) for at in range(0, size, cycle)]
    if min(falls) < _COLLAPSE * peak:  # a load that has switched off, once
        return False
    fall = max(falls)
    if fall < _FASTER * float(change.max()):
        return False
    after = int(change.argmin()) + 2 * short  # the collapse itself takes as long
    rest = np.abs(x[after : after + short])
    return bool(len(rest) and rest.max() < _REST * peak)


def flags_of(values: Codes, cycle: int, look: Look | None = None) -> frozenset[str]:
    """Flags of some whole cycles of `cycle` samples of U1, I1, U2, I2 ... [samples, channels], as codes or values.

    `look`: at these samples. A channel is examined only where its steps, its extremes or its halves allow a fault: a
    look takes a tenth so long.
    """
    seen = look or look_at(values, cycle)
    found = set()
    columns = zip(seen.step, seen.least, seen.most, seen.at_least, seen.at_most, strict=True)
    for k, (step, least, most, at_least, at_most) in enumerate(columns):
        if step > _WRAP * (most - least) and rolled_over(_channel(values, k), cycle):
            found.add("rollover")
        elif max(at_least, at_most) >= _FLAT and clipped(_channel(values, k), cycle):
            found.add("clipped")
    size = len(values) // cycle * cycle
    if size:
        volts = zip(seen.total[0::2], seen.squares[0::2], strict=True)
        if any(abs(total / size) > _OFFSET * _spread(total / size, square / size) for total, square in volts):
            found.add("offset")
        half = cycle // 2
        halves = zip(seen.opposite[1::2], seen.magnitudes[1::2], strict=True)
        suspects = [k for k, (sums, each) in enumerate(halves) if sums * size > _UNEVEN * each * half]
        if any(saturated(_channel(values, 2 * k + 1)[:size], cycle) for k in suspects):
            found.add("saturated")
    return frozenset(found)


def _channel(values: Codes, k: int) -> Floats:
    return np.ascontiguousarray(values[:, k], dtype=np.float64)


def _spread(mean: float, square: float) -> float:
    """Alternating RMS."""
    return math.sqrt(max(square - mean * mean, 0.0))


def uneven(x: Floats, cycle: int) -> list[int]:
    """Rows of cycles [rows, samples] whose halves differ: even harmonics, without which no core is saturated."""
    half = cycle // 2
    opposite = np.abs(x[:, :half] + x[:, half : 2 * half]).mean(axis=1)
    return np.flatnonzero(opposite > _UNEVEN * np.abs(x).mean(axis=1)).tolist()
