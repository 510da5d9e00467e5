"""Velocity and acceleration of sampled joint angles (thesis Eq. 7.16, 7.17)."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats


def padded(q: Floats, radius: int) -> Floats:
    """Angles [T, axes] with both ends repeated `radius` times: [T + 2 radius, axes]."""
    return np.concatenate([np.repeat(q[:1], radius, axis=0), q, np.repeat(q[-1:], radius, axis=0)])


def derivatives(q: Floats, step_s: float) -> tuple[Floats, Floats]:
    """Velocity [rad/s] and acceleration [rad/s^2], both [T, axes], of angles [T + 2, axes] by central differences."""
    before, here, after = q[:-2], q[1:-1], q[2:]
    return (after - before) / (2 * step_s), (after - 2 * here + before) / step_s**2


def motion(q: Floats, step_s: float) -> tuple[Floats, Floats, Floats]:
    """q, qd and qdd, each [T, axes], of angles [T, axes]."""
    return (q, *derivatives(padded(q, 1), step_s))
