"""Moments at which a motion may begin again: departures from a pose of rest, and passes through a state in motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.noise_floor import STILL_RAD_S
from acqd.numerics import runs_of_true

_FEWEST = 4
"""Marks, that is three cycles."""
_RESTING = 4 * STILL_RAD_S
"""Speed of the fastest joint at rest, with the noise of a coarse encoder (rad/s)."""
_SHORTEST_REST_ROWS = 3
_SAME_POSE = 0.05
"""Distance between poses that count as the same, as a share of the spread of the motion."""
_GONE = 1e-3
"""rad from the pose of rest behind which the departure is extrapolated."""
_ANCHORS = 32
"""States in motion that are tried."""
_NEAR = 0.1
"""Distance from such a state, as a share of the spread."""
_PARALLEL = 0.9
"""Least cosine between the directions of two passes."""


@dataclass(frozen=True, slots=True)
class Marks:
    """Times at which the same state was left or passed."""

    rows: Floats
    """[n] rising, in rows from the first one; fractions by interpolation."""
    rest: float
    """Mean rest before the marks, in rows; 0 in motion."""


def spread_of(q: Floats) -> float:
    """RMS distance of angles [T, axes] from their mean, rad."""
    return float(np.sqrt(((q - q.mean(axis=0)) ** 2).sum(axis=1).mean()))


def resting_rows(qd: Floats) -> np.ndarray:
    """[T] True where no joint moves, from speeds [T, axes] rad/s; at least three rows in a row."""
    resting = np.zeros(len(qd), dtype=bool)
    for first, last in runs_of_true(np.abs(qd).max(axis=1) < _RESTING):
        resting[first:last] = last - first >= _SHORTEST_REST_ROWS
    return resting


def marks_of(q: Floats, qd: Floats) -> Iterator[Marks]:
    """Candidates, of angles [T, axes] rad and speeds [T, axes] rad/s."""
    spread = spread_of(q)
    yield from _departures(q, resting_rows(qd), spread)
    yield from _passes(q, qd, spread)


def _departures(q: Floats, resting: np.ndarray, spread: float) -> Iterator[Marks]:
    """For every pose of rest that comes again: when the arm leaves it."""
    rests = [(first, last) for first, last in runs_of_true(resting) if last < len(q)]
    poses = np.array([q[first:last].mean(axis=0) for first, last in rests]).reshape(-1, q.shape[1])
    left = np.ones(len(rests), dtype=bool)
    while left.any():
        first = int(np.argmax(left))
        same = left & (np.linalg.norm(poses - poses[first], axis=1) < _SAME_POSE * spread)
        left &= ~same
        chosen = [rests[k] for k in np.flatnonzero(same)]
        if len(chosen) >= _FEWEST:
            rows = np.array([_left(q, *each) for each in chosen])
            yield Marks(rows, float(np.mean([last - begin for begin, last in chosen])))


def _left(q: Floats, first: int, last: int) -> float:
    """Row at which the arm leaves a rest: the distance grows with the square of time at constant acceleration."""
    distance = np.linalg.norm(q[last - 1 : last + 8] - q[first:last].mean(axis=0), axis=1)
    beyond = np.flatnonzero((distance[:-1] > _GONE) & (distance[1:] > distance[:-1]))
    if not len(beyond):
        return float(last)
    k = int(beyond[0])
    one, two = np.sqrt(distance[k : k + 2])
    return float(np.clip(last - 1 + k - one / (two - one), last - 3, last - 1 + k))


def _passes(q: Floats, qd: Floats, spread: float) -> Iterator[Marks]:
    """For some states in motion: when the arm passes the plane across the motion there, in the same direction."""
    speed = np.linalg.norm(qd, axis=1)
    fast = np.flatnonzero(speed > np.median(speed[speed > _RESTING])) if (speed > _RESTING).any() else np.zeros(0, int)
    for anchor in fast[np.linspace(0, len(fast) - 1, _ANCHORS).astype(int)] if len(fast) > _ANCHORS else fast:
        ahead = qd[anchor] / speed[anchor]
        along = (q - q[anchor]) @ ahead
        near = np.linalg.norm(q - q[anchor], axis=1) < _NEAR * spread
        parallel = qd @ ahead > _PARALLEL * speed
        rows = np.flatnonzero((along[:-1] < 0) & (along[1:] >= 0) & near[:-1] & parallel[:-1])
        if len(rows) >= _FEWEST:
            yield Marks(rows - along[rows] / (along[rows + 1] - along[rows]), 0.0)
