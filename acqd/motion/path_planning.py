"""Collision-free paths between two positions by RRT-Connect: rapidly exploring random trees from both ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.robot.collision import CollisionChecker, dense_path

_Free: TypeAlias = Callable[[Floats, Floats], bool]
"""Whether the straight path between two positions is free."""
_STEP = 0.4  # rad, growth of a tree in one step
_ROUNDS = 4000


def find_path(
    checker: CollisionChecker, start: Floats, end: Floats, limits: tuple[Floats, Floats], check_step: float
) -> list[Floats] | None:
    """Positions after `start`, up to `end`, joined by free straight paths; None if none were found.

    Paths are checked every `check_step` (rad). The method is RRT-Connect (Kuffner and LaValle 2000), followed by
    shortcuts. The random numbers are seeded by the positions, so that the same call gives the same path.
    """

    def free(a: Floats, b: Floats) -> bool:
        return not checker.path_collides(dense_path(np.array([a, b]), check_step))

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
                path = [*forward.path(joints[0]), *reversed(backward.path(joints[1])[:-1])]
                return _with_shortcuts(path, free)[1:]
        near, far = far, near
    return None


class _Tree:
    def __init__(self, root: Floats) -> None:
        self.nodes = [root]
        self._parents = [-1]

    def grow(self, target: Floats, free: _Free) -> int | None:
        """Grow one step from the nearest node towards `target`; the number of the new node, None if blocked."""
        nearest = int(np.argmin([np.abs(node - target).max() for node in self.nodes]))
        offset = target - self.nodes[nearest]
        distance = np.abs(offset).max()
        node = target if distance <= _STEP else self.nodes[nearest] + offset * (_STEP / distance)
        if distance < 1e-9 or not free(self.nodes[nearest], node):
            return None
        self.nodes.append(node)
        self._parents.append(nearest)
        return len(self.nodes) - 1

    def grow_until(self, target: Floats, free: _Free) -> int | None:
        """Grow step by step up to `target`; the number of the node there, None if blocked."""
        while (number := self.grow(target, free)) is not None:
            if np.array_equal(self.nodes[number], target):
                return number
        return None

    def path(self, number: int) -> list[Floats]:
        """Positions from the root to a node."""
        path = []
        while number >= 0:
            path.append(self.nodes[number])
            number = self._parents[number]
        return path[::-1]


def _with_shortcuts(path: list[Floats], free: _Free) -> list[Floats]:
    """The path without the detours that a free straight path can replace."""
    kept = [path[0]]
    at = 0
    while at < len(path) - 1:
        at = next(k for k in range(len(path) - 1, at, -1) if k == at + 1 or free(path[at], path[k]))
        kept.append(path[at])
    return kept
