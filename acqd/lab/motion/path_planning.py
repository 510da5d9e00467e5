"""A way between two positions where the straight one collides: rapidly growing random trees from both ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.robot.collision import CollisionChecker, dense_path

_Free: TypeAlias = Callable[[Floats, Floats], bool]
_STEP = 0.4  # rad that a tree grows at once
_ROUNDS = 4000


def find_way(
    checker: CollisionChecker, start: Floats, end: Floats, limits: tuple[Floats, Floats], check_step: float
) -> list[Floats] | None:
    """Positions after `start` up to `end` whose straight ways are free, checked every `check_step` (rad); or None.

    RRT-Connect (Kuffner and LaValle 2000), then every detour that a straight way can replace is left out.
    The trees are seeded by the positions, so that the same question has the same answer.
    """

    def free(one: Floats, other: Floats) -> bool:
        return not checker.path_collides(dense_path(np.array([one, other]), check_step))

    if free(start, end):
        return [end]
    random = np.random.default_rng(np.abs(np.round(np.concatenate([start, end]) * 1e6)).astype(np.int64))
    near, far = _Tree(start), _Tree(end)
    for number in range(_ROUNDS):
        target = random.uniform(*limits)
        reached = near.grow(target, free)
        if reached is not None:
            met = far.grow_until(near.nodes[reached], free)
            if met is not None:
                forward, backward = (near, far) if number % 2 == 0 else (far, near)
                joints = (reached, met) if number % 2 == 0 else (met, reached)
                way = [*forward.path(joints[0]), *reversed(backward.path(joints[1])[:-1])]
                return _straightened(way, free)[1:]
        near, far = far, near
    return None


class _Tree:
    def __init__(self, root: Floats) -> None:
        self.nodes = [root]
        self._parents = [-1]

    def grow(self, target: Floats, free: _Free) -> int | None:
        """One step from the nearest node towards `target`; the new node's number, None when it is blocked."""
        nearest = int(np.argmin([np.abs(node - target).max() for node in self.nodes]))
        way = target - self.nodes[nearest]
        reach = np.abs(way).max()
        node = target if reach <= _STEP else self.nodes[nearest] + way * (_STEP / reach)
        if reach < 1e-9 or not free(self.nodes[nearest], node):
            return None
        self.nodes.append(node)
        self._parents.append(nearest)
        return len(self.nodes) - 1

    def grow_until(self, target: Floats, free: _Free) -> int | None:
        """Step by step up to `target`; the number of the node there, None when something is in the way."""
        while (number := self.grow(target, free)) is not None:
            if np.array_equal(self.nodes[number], target):
                return number
        return None

    def path(self, number: int) -> list[Floats]:
        """From the root to a node."""
        path = []
        while number >= 0:
            path.append(self.nodes[number])
            number = self._parents[number]
        return path[::-1]


def _straightened(way: list[Floats], free: _Free) -> list[Floats]:
    kept = [way[0]]
    at = 0
    while at < len(way) - 1:
        at = next(k for k in range(len(way) - 1, at, -1) if k == at + 1 or free(way[at], way[k]))
        kept.append(way[at])
    return kept
