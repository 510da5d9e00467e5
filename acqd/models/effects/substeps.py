"""Motion at four substeps a row, and means over rows.

A meter averages over its window. Physics computed in the middle of the window only is wrong wherever the arm speeds
up, stops or turns round, and those errors look like brakes and Stribeck friction.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.first_order import filtered
from acqd.models.greybox.model import lag_filter

SUBSTEPS = 4
"""Points of motion per row."""
RADIUS = 2
"""Rows on each side of a row that its motion is interpolated from."""


def substep_weights(step_s: float) -> Floats:
    """[3, SUBSTEPS, 2 RADIUS + 1]: value, first and second derivative of the interpolating polynomial (Lagrange)."""
    nodes = np.arange(-RADIUS, RADIUS + 1) * 1.0
    points = (np.arange(SUBSTEPS) + 0.5) / SUBSTEPS - 0.5
    inverse = np.linalg.inv(np.vander(nodes, increasing=True))  # coefficients of the polynomial per node
    powers = np.arange(len(nodes))
    weights = np.zeros((3, SUBSTEPS, len(nodes)))
    for k, x in enumerate(points):
        weights[0, k] = x**powers @ inverse
        weights[1, k] = (powers[1:] * x ** (powers[1:] - 1)) @ inverse[1:] / step_s
        weights[2, k] = (powers[2:] * (powers[2:] - 1) * x ** (powers[2:] - 2)) @ inverse[2:] / step_s**2
    return weights


def substep_motion(q: Floats, step_s: float) -> tuple[Floats, Floats, Floats]:
    """q, qd, qdd [SUBSTEPS T, axes] from angles [T + 2 RADIUS, axes]."""
    rows = len(q) - 2 * RADIUS
    around = np.stack([q[k : k + rows] for k in range(2 * RADIUS + 1)], axis=1)  # [T, nodes, axes]
    motion = np.einsum("dsn,tna->dtsa", substep_weights(step_s), around, optimize=True)
    return tuple(each.reshape(rows * SUBSTEPS, q.shape[1]) for each in motion)


def substep_switch(share: Floats) -> Floats:
    """[SUBSTEPS T] 0/1 from the share [T] of every row in which a signal is on; it switches once within a row."""
    after, before = np.append(share[1:], share[-1:]), np.append(share[:1], share[:-1])
    rising = (after > before)[:, None]
    points = (np.arange(SUBSTEPS) + 0.5) / SUBSTEPS
    on = np.where(rising, points > 1 - share[:, None], points < share[:, None])
    return np.asarray(on.ravel(), dtype=np.float64)


def substep_times(start_s: float, rows: int, step_s: float) -> Floats:
    """[SUBSTEPS T] s, UTC, of T rows; the middle of the first row is at `start_s`."""
    return np.asarray(start_s + ((np.arange(rows * SUBSTEPS) + 0.5) / SUBSTEPS - 0.5) * step_s)


def averaged(values: Floats) -> Floats:
    """[T, ...] means over the rows of values [SUBSTEPS T, ...]."""
    total = np.add(values[::SUBSTEPS], values[1::SUBSTEPS], dtype=np.float64)
    for k in range(2, SUBSTEPS):
        total += values[k::SUBSTEPS]
    return np.asarray(total / SUBSTEPS)


class Lag:
    """The supply's first-order lag at the substep, as a filter that keeps its state between calls."""

    def __init__(self, lag_s: float, step_s: float) -> None:
        self._b, self._a = lag_filter(lag_s, step_s / SUBSTEPS)
        self._state: Floats | None = None

    def run(self, values: Floats) -> Floats:
        """Filtered values along the first axis; the filter starts at rest at the very first value."""
        return self._filtered(values, 1)

    def means(self, values: Floats) -> Floats:
        """[T, ...] `averaged` filtered values [SUBSTEPS T, ...]."""
        return self._filtered(values, SUBSTEPS)

    def _filtered(self, values: Floats, together: int) -> Floats:
        if self._state is None:
            self._state = values[:1] * (1 - self._b[0])
        out, self._state = filtered(self._b, self._a, values, self._state, together)
        return out
