"""Cycles of repeating motion, from joint angles alone.

A cycle goes from one mark to the next, and its path in the space of the joints is that of most others. Paths are
compared by their length, not by time, so that waiting and slow motion change nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.features import derivatives, padded
from acqd.work.marks import Marks, marks_of, resting_rows, spread_of

_POINTS = 48
"""Points of a path that are compared."""
_SAME_PATH = 0.15
"""RMS distance between paths of cycles, as a share of the spread of the motion."""
_SAME_LENGTH = 0.2
"""Relative difference of the lengths of their paths."""
_FEWEST = 3
"""Cycles; two like motions may be chance."""
_COVERED = 0.6
"""Least share of the motion that lies in cycles, or nothing is claimed."""
_AS_GOOD = 0.05
"""Difference of the share between marks within which the marks with the longest rest are preferred."""
_MOST = 600
"""Stretches between marks that are compared with one another."""


@dataclass(frozen=True, slots=True)
class Found:
    """Cycles of one recording."""

    begin: Floats
    """[n] in rows from the first one, with fractions."""
    end: Floats
    covered: float
    """Share of the rows in motion that lie in cycles."""
    between_marks: float
    """The same of the motion from the first mark to the last one: what lies before and after has no cycle to be in."""
    path: Floats
    """[points, axes] rad: the commonest path, at equal distances."""

    @property
    def boundaries(self) -> Floats:
        """Begins and ends, each once."""
        return np.unique(np.concatenate([self.begin, self.end]))


def cycles_of(q: Floats, step_s: float) -> Found:
    """Cycles in angles [T, axes] rad of rows `step_s` apart; none where the motion does not repeat.

    A cycle begins where the arm leaves its longest rest. Without rests, the cycle begins at a state in motion.
    """
    none = Found(np.zeros(0), np.zeros(0), 0.0, 0.0, np.zeros((0, q.shape[1])))
    if len(q) < 3 or spread_of(q) == 0:
        return none
    qd, _ = derivatives(padded(q, 1), step_s)
    moving = ~resting_rows(qd)
    if not moving.any():
        return none
    candidates = [(marks, found) for marks in marks_of(q, qd) if (found := _between(marks, q, moving)) is not None]
    candidates = [each for each in candidates if each[1].covered >= _COVERED]
    if not candidates:
        return none
    best = max(found.between_marks for _, found in candidates)
    good = [each for each in candidates if each[1].between_marks >= best - _AS_GOOD]
    return max(good, key=lambda each: (each[0].rest, each[1].covered))[1]


def same_path(one: Found, other: Found) -> bool:
    """Whether two recordings repeat the same motion."""
    spread = min(spread_of(one.path), spread_of(other.path))
    distance = np.sqrt(((one.path - other.path) ** 2).sum(axis=1).mean())
    return bool(distance <= _SAME_PATH * spread)


def _between(marks: Marks, q: Floats, moving: NDArray[np.bool_]) -> Found | None:
    """Stretches between marks that take the commonest path; None if these are too few."""
    begin, end = marks.rows[:-1], marks.rows[1:]
    chosen = np.unique(np.linspace(0, len(begin) - 1, min(len(begin), _MOST)).astype(int))
    paths, lengths = zip(*(_path(q, first, last) for first, last in zip(begin, end, strict=True)), strict=True)
    points, length = np.array(paths), np.array(lengths)
    spread = spread_of(q)
    alike = np.array([_alike(points, length, k, spread) for k in chosen])
    commonest = int(alike.sum(axis=1).argmax())
    same = alike[commonest]
    if same.sum() < _FEWEST:
        return None
    inside = np.zeros(len(q), dtype=bool)
    for first, last in zip(np.ceil(begin[same]).astype(int), np.ceil(end[same]).astype(int), strict=True):
        inside[first:last] = True
    in_cycles, marked = (moving & inside).sum(), moving[int(np.ceil(begin[0])) : int(np.ceil(end[-1]))].sum()
    covered, between_marks = float(in_cycles / moving.sum()), float(in_cycles / max(marked, 1))
    return Found(begin[same], end[same], covered, between_marks, points[chosen[commonest]])


def _path(q: Floats, begin: float, end: float) -> tuple[Floats, float]:
    """Points [_POINTS, axes] at equal distances along a stretch, and its length in rad."""
    rows = q[int(np.ceil(begin)) : int(np.ceil(end)) + 1]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rows, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], _POINTS)
    return np.column_stack([np.interp(at, along, column) for column in rows.T]), float(along[-1])


def _alike(points: Floats, length: Floats, number: int, spread: float) -> NDArray[np.bool_]:
    """[n] whether the path of each stretch is that of stretch `number`."""
    distance = np.sqrt(((points - points[number]) ** 2).sum(axis=2).mean(axis=1))
    near = np.abs(length - length[number]) <= _SAME_LENGTH * length[number]
    return np.asarray((distance <= _SAME_PATH * spread) & near & (length > spread))
