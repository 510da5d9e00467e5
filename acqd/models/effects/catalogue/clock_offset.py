"""A constant offset between the clocks of robot and meter."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.clocks import later, slope
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import LARGEST_OFFSET_S
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene


class ClockOffset(Effect):
    """Metered power is later than motion by a constant time."""

    id = "clock_offset"
    cause = Cause.METER
    summary = "the robot's clock and the meter's are apart"
    equation = "P = -dP/dt dt"
    neighbours = ("stribeck_friction", "brake_release")
    experiment = "align the recordings again, or synchronise the clocks"
    acts_on = "clock"
    structural = False
    exported = False
    omitted_because = "a clock error is not a property of the robot"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[T, 1] W/s for a small offset; with `seconds` in the shape, W for exactly that offset."""
        if "seconds" in shape:
            return (later(scene, np.full(scene.rows, shape["seconds"])) - scene.predicted)[:, None]
        return -slope(scene)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """The clocks."""
        yield Place("clocks", (0,), (Parameter("power later by", "s", -LARGEST_OFFSET_S, LARGEST_OFFSET_S),))
