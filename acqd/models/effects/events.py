"""Loads that signals switch: brakes and tools."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect, Parameter, Place, Shape, bins, edges, since
from acqd.models.effects.scene import Scene


class BrakeRelease(Effect):
    """The peak when the brakes open (thesis Figures 6.2 and 9.4)."""

    id = "brake_release"
    summary = "a peak when the brakes open: pull-in current of the coils and inrush of the motors"
    equation = "P = h(time since the brakes opened), free within 0.6 s"
    neighbours = ("clock_offset", "brake_holding")
    experiment = "release the brakes ten times without moving"
    _limits: ClassVar = (-0.02, 0.02, 0.06, 0.10, 0.16, 0.24, 0.36, 0.6)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """W in each interval after the opening; without a brake signal, after the recording's first motion."""
        return bins(self.age(scene), self._limits)

    def age(self, scene: Scene) -> Floats:
        """[N] s since the brakes opened."""
        if "brake" in scene.signals:
            rises, _ = edges(scene.signals["brake"], scene, "brake")
            return since(rises, scene, "brake_age")
        return np.full(len(scene.q), np.inf)

    def possible(self, scene: Scene) -> bool:
        """With a brake signal."""
        return "brake" in scene.signals

    def places(self, scene: Scene) -> Iterator[Place]:
        """The shape is free."""
        count = len(self._limits) - 1
        names = tuple(
            Parameter(f"power {max(low, 0) * 1000:.0f}-{high * 1000:.0f} ms", "W")
            for low, high in zip(self._limits, self._limits[1:], strict=False)
        )
        yield Place("brakes", tuple(range(count)), names)


class BrakeHolding(Effect):
    """Current that keeps brakes open."""

    id = "brake_holding"
    summary = "power of the brake coils while the brakes are open"
    equation = "P = P_b while open"
    neighbours = ("offset_shift", "brake_release")
    experiment = "two minutes at rest with the brakes open, two with them closed"
    needs = ("brake",)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """One."""
        return scene.signals["brake"][:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """One."""
        yield Place("brakes", (0,), (Parameter("power", "W"),))


class ToolActuation(Effect):
    """An electric gripper."""

    id = "tool_actuation"
    summary = "the tool takes power while it is on, and a pulse whenever it switches"
    equation = "P = P_t tool + h(time since switching)"
    neighbours = ("payload", "process_load")
    experiment = "switch the tool ten times at rest, with nothing in it"
    needs = ("tool",)
    _limits: ClassVar = (-0.02, 0.1, 0.2, 0.4, 0.7)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """While on, then the pulse."""
        rises, falls = edges(scene.signals["tool"], scene, "tool")
        age = since(rises + falls, scene, "tool_age")
        return np.column_stack([scene.signals["tool"], bins(age, self._limits)])

    def places(self, scene: Scene) -> Iterator[Place]:
        """With the pulse, and without."""
        pulse = tuple(
            Parameter(f"pulse {max(low, 0) * 1000:.0f}-{high * 1000:.0f} ms", "W")
            for low, high in zip(self._limits, self._limits[1:], strict=False)
        )
        yield Place("tool", (0,), (Parameter("power", "W"),))
        yield Place("tool", (0, 1, 2, 3, 4), (Parameter("power", "W"), *pulse))
