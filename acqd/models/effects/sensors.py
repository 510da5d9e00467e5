"""Nothing wrong with the robot: the meter or a clock is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect, Parameter, Place, Shape
from acqd.models.effects.scene import Lag, Scene, averaged


class MeterGain(Effect):
    """The meter reads a share too much, or too little."""

    id = "meter_gain"
    summary = "everything measured is off by the same share: the current transformer or its setting"
    equation = "P = g P_model"
    neighbours = ("supply_efficiency", "offset_shift")
    experiment = "compare with a second meter at rest and under load"
    stage = "meter"
    structural = False

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """One."""
        return scene.predicted[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """One."""
        yield Place("meter", (0,), (Parameter("gain error", "-"),))


class MeterSaturation(Effect):
    """The current channel clips."""

    id = "meter_saturation"
    summary = "power above a ceiling is missing: the current range is too small"
    equation = "P = -s max(P_model - L, 0)"
    neighbours = ("supply_efficiency", "meter_gain")
    experiment = "look at the waveform's peaks, or choose the next current range"
    stage = "meter"
    structural = False
    shapes = tuple({"ceiling_of_standby": ceiling} for ceiling in (1.1, 1.2, 1.3, 1.4, 1.55, 1.7, 2.0, 2.4, 2.9, 3.5))
    bounds: ClassVar = {"ceiling_of_standby": (1.0, 6.0)}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Ceilings are in multiples of the standby power."""
        ceiling = shape["ceiling_of_standby"] * float(scene.model.group("standby")[0])
        return -np.maximum(scene.predicted - ceiling, 0.0)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """One."""
        yield Place("meter", (0,), (Parameter("share lost above", "-", 0.0, 1.3),))


class ClockOffset(Effect):
    """Power and motion are not at the same time."""

    id = "clock_offset"
    summary = "the robot's clock and the meter's are apart"
    equation = "P = -dP/dt dt"
    neighbours = ("stribeck_friction", "brake_release")
    experiment = "align the recordings again, or synchronise the clocks"
    stage = "meter"
    structural = False

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """W/s for a small offset; the whole difference for one that is known."""
        if shape:
            return (later(scene, np.full(scene.rows, shape["seconds"])) - scene.predicted)[:, None]
        return -slope(scene)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """One."""
        yield Place("clocks", (0,), (Parameter("power later by", "s"),))


class ClockDrift(Effect):
    """Power and motion drift apart."""

    id = "clock_drift"
    summary = "the robot's clock and the meter's drift apart"
    equation = "P = -dP/dt r t"
    neighbours = ("clock_offset",)
    experiment = "align the recordings again, over a longer time"
    stage = "meter"
    structural = False

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """W per s/h for a small drift; the whole difference for one that is known."""
        if shape:
            passed = averaged(scene.t) - scene.memory.get("origin_s", float(scene.t[0]))
            delays = shape["seconds"] + shape["seconds_per_hour"] * passed / 3600
            return (later(scene, delays) - scene.predicted)[:, None]
        origin_s = scene.memory.get("origin_s", -np.inf)
        hours = np.where(np.isfinite(origin_s), averaged(scene.t) - origin_s, 0.0) / 3600
        return (-slope(scene) * hours)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """One."""
        yield Place("clocks", (0,), (Parameter("power later by", "s/h"),))


def later(scene: Scene, delays: Floats) -> Floats:
    """[T] W: the predicted power, each row as it was `delays` [T] s before."""
    t = averaged(scene.t)
    return np.interp(t - delays, t, scene.predicted)


def slope(scene: Scene) -> Floats:
    """[T] W/s of the predicted power."""
    lag_s = float(scene.model.group("lag")[0])
    delayed = averaged(Lag(lag_s + 0.01, scene.step_s).run(scene.drives))
    return (averaged(Lag(lag_s, scene.step_s).run(scene.drives)) - delayed) / 0.01
