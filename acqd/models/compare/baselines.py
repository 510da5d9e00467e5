"""Baselines of every comparison: the mean power, and a linear regression without a robot description."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.segments import Segment
from acqd.numerics import ridge_regression

_RIDGE = 1e-6


def constant(training: list[Segment], segments: list[Segment]) -> list[Floats]:
    """Mean power of the training segments, [T] W for each segment."""
    mean = float(np.concatenate([segment.P for segment in training]).mean())
    return [np.full(len(segment.P), mean) for segment in segments]


def linear_physics(training: list[Segment], segments: list[Segment], step_s: float) -> list[Floats]:
    """Ridge regression on |qd|, qd^2, qd qdd, qdd^2, sin q, cos q and their products with qd: [T] W per segment."""
    X = np.concatenate([_regressors(segment, step_s) for segment in training])
    y = np.concatenate([segment.P for segment in training])
    weights = ridge_regression(X, y, _RIDGE)
    return [np.asarray(_regressors(segment, step_s) @ weights) for segment in segments]


def _regressors(segment: Segment, step_s: float) -> Floats:
    q, qd, qdd = segment.motion(step_s)
    gravity = [np.sin(q) * qd, np.cos(q) * qd, np.sin(q), np.cos(q)]
    return np.column_stack([np.abs(qd), qd**2, qd * qdd, qdd**2, *gravity, np.ones(len(q))])
