"""What no report may lack: a constant, a linear regression on physics, and what the meter itself scatters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.features import motion
from acqd.models.segments import Dataset, Segment
from acqd.numerics import mad_sigma, ridge_regression, runs_of_true

_RIDGE = 1e-6
_STILL_RAD_S = 2e-3
_SETTLING = 6  # rows after a motion that are not noise yet
_LEAST_ROWS = 12
_LEAST_TOTAL = 100


def constant(training: list[Segment], segments: list[Segment]) -> list[Floats]:
    """The training recordings' mean power."""
    mean = float(np.concatenate([segment.P for segment in training]).mean())
    return [np.full(len(segment.P), mean) for segment in segments]


def linear_physics(training: list[Segment], segments: list[Segment], step_s: float) -> list[Floats]:
    """Least squares on |qd|, qd^2, qd qdd, qdd^2, and sines and cosines of the angles: no robot description."""
    X = np.concatenate([_regressors(segment, step_s) for segment in training])
    y = np.concatenate([segment.P for segment in training])
    weights = ridge_regression(X, y, _RIDGE)
    return [np.asarray(_regressors(segment, step_s) @ weights) for segment in segments]


def _regressors(segment: Segment, step_s: float) -> Floats:
    q, qd, qdd = motion(segment.q, step_s)
    gravity = [np.sin(q) * qd, np.cos(q) * qd, np.sin(q), np.cos(q)]
    return np.column_stack([np.abs(qd), qd**2, qd * qdd, qdd**2, *gravity, np.ones(len(q))])


def noise_floor(data: Dataset) -> float | None:
    """MAE (W) that a perfect model would have: how power scatters about its slow mean while the robot stands still.

    None with too little standstill in the recordings.
    """
    apart = []
    for segment in data.segments:
        _, qd, _ = motion(segment.q, data.step_s)
        still: NDArray[np.bool_] = np.all(np.abs(qd) < _STILL_RAD_S, axis=1)
        for first, last in runs_of_true(still):
            inner = segment.P[first + _SETTLING : last - 2]
            if len(inner) >= _LEAST_ROWS:
                apart.append(inner - np.median(inner))
    if sum(map(len, apart)) < _LEAST_TOTAL:
        return None
    deviation = mad_sigma(np.concatenate(apart), 0.0)  # robust: brakes open at standstill, too
    return deviation * float(np.sqrt(2 / np.pi))
