"""Integrals of a sampled signal between fractional sample positions.

Sample k represents the cell [k, k + 1). Inside the two cells that an interval cuts, the signal is
taken as the straight line through its neighbours, so that the mean over whole periods converges
with the third power of the step instead of the first; for a whole number of cells the result is
the plain sum, to the last bit.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats


def interval_sums(x: Floats, start: Floats, stop: Floats) -> Floats:
    """Integral of `x` [..., samples] over the cells start[k] .. stop[k], shape [..., intervals].

    Bounds are in samples, 0 <= start < stop <= samples; each interval spans at least one cell.
    """
    bounds = np.concatenate((start, stop))
    cells = np.floor(bounds).astype(np.int64)
    count = len(start)
    parts = _partial(x, cells, bounds - cells)
    whole = _segment_sums(x, cells[:count], cells[count:])
    return whole - parts[..., :count] + parts[..., count:]


def _partial(x: Floats, cell: np.ndarray, share: Floats) -> Floats:
    """Integral over the first `share` of each cell."""
    last = x.shape[-1] - 1
    middle = np.minimum(cell, last)  # stop == samples has share 0: any cell will do
    slope = (x[..., np.minimum(middle + 1, last)] - x[..., np.maximum(middle - 1, 0)]) / 2
    result: Floats = share * x[..., middle] + (share * share - share) / 2 * slope
    return result


def _segment_sums(x: Floats, first: np.ndarray, end: np.ndarray) -> Floats:
    """Plain sums of x[..., first:end]; segments may overlap."""
    if len(first) == 1:
        return np.asarray(x[..., first[0] : end[0]].sum(axis=-1, keepdims=True))
    bounds = np.empty(2 * len(first), dtype=np.int64)
    bounds[0::2], bounds[1::2] = first, end
    if bounds[-1] == x.shape[-1]:
        bounds = bounds[:-1]  # reduceat runs its last segment to the end by itself
    return np.asarray(np.add.reduceat(x, bounds, axis=-1)[..., 0::2])
