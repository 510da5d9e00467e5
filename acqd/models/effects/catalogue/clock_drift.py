"""A drift between the clocks of robot and meter."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.clocks import later, slope
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import LARGEST_DRIFT_S_H
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged


class ClockDrift(Effect):
    """Metered power is later than motion by a time that grows at a constant rate."""

    id = "clock_drift"
    cause = Cause.METER
    summary = "the robot's clock and the meter's drift apart"
    equation = "P = -dP/dt r t"
    neighbours = ("clock_offset",)
    experiment = "align the recordings again, over a longer time"
    acts_on = "clock"
    structural = False
    follows_clock = True
    exported = False
    omitted_because = "a clock error is not a property of the robot"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[T, 1] W per s/h for a small drift; with `seconds` and `seconds_per_hour`, W for exactly that drift."""
        if "seconds" in shape:
            passed = averaged(scene.t) - scene.memory.get("origin_s", float(scene.t[0]))
            delays = shape["seconds"] + shape["seconds_per_hour"] * passed / 3600
            return (later(scene, delays) - scene.predicted)[:, None]
        origin_s = scene.memory.get("origin_s", -np.inf)
        hours = np.where(np.isfinite(origin_s), averaged(scene.t) - origin_s, 0.0) / 3600
        return (-slope(scene) * hours)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """The clocks."""
        yield Place("clocks", (0,), (Parameter("power later by", "s/h", -LARGEST_DRIFT_S_H, LARGEST_DRIFT_S_H),))
