"""Edges of switched signals and the time since them; both continue over consecutive scenes."""

from __future__ import annotations

import itertools

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene


def edges(switch: Floats, scene: Scene, name: str) -> tuple[Floats, Floats]:
    """[N] 1 at rising edges, and [N] 1 at falling edges, of a 0/1 signal [N].

    The scene's memory keeps the last value as `name`.
    """
    before = float(scene.memory.get(name, switch[0]))
    change = np.diff(switch, prepend=before)
    scene.memory[name] = float(switch[-1])
    return (change > 0.5).astype(float), (change < -0.5).astype(float)


def since(events: Floats, scene: Scene, name: str, before: float = np.inf) -> Floats:
    """[N] s since the last substep where `events` [N] is not 0; `before` s if there was no event yet.

    The scene's memory keeps the last age as `name`.
    """
    at = np.arange(len(events))
    last = np.maximum.accumulate(np.where(events != 0, at, -1))
    earlier = float(scene.memory.get(name, before))
    age = np.where(last >= 0, (at - last) * scene.substep_s, earlier + (at + 1) * scene.substep_s)
    scene.memory[name] = float(age[-1])
    return np.asarray(age)


def bins(age: Floats, limits: tuple[float, ...]) -> Floats:
    """[N, len(limits) - 1] 1 where `age` [N] lies in the half-open interval between two limits."""
    inside = [(age >= low) & (age < high) for low, high in itertools.pairwise(limits)]
    return np.column_stack(inside).astype(np.float64)
