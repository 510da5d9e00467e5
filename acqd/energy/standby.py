"""Energy at rest: buckets in which no row rises clearly above the lowest level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.storage.buckets import Buckets

_LOWEST, _HIGHEST = 2.0, 99.0
"""Percentiles of the means, and of the maxima, that are the level at rest and the highest load."""
_MARGIN = 0.1
"""A bucket is at rest while its largest row stays below this share of the way from the level to the highest load."""
_DISTINCT = 1.3
"""Highest load over level below which rest and work cannot be told apart by power."""


@dataclass(frozen=True, slots=True)
class Standby:
    """Which buckets are at rest, and at what power."""

    W: float
    """Mean power at rest."""
    limit_W: float
    """Largest row of a bucket at rest."""
    at_rest: np.ndarray
    """[n] per bucket."""
    bucket_s: int


def standby_of(buckets: Buckets) -> Standby | None:
    """None where rest and work do not differ in power, or where the machine never rests for a whole bucket."""
    known = np.isfinite(buckets.P) & np.isfinite(buckets.P_max)
    if not known.any():
        return None
    level = float(np.percentile(buckets.P[known], _LOWEST))
    highest = float(np.percentile(buckets.P_max[known], _HIGHEST))
    if level <= 0 or highest < _DISTINCT * level:
        return None
    limit = level + _MARGIN * (highest - level)
    at_rest = known & (buckets.P_max < limit)
    if not at_rest.any():
        return None
    mean = float(np.average(buckets.P[at_rest], weights=buckets.rows[at_rest]))
    return Standby(mean, limit, at_rest, int(np.median(buckets.seconds)))
