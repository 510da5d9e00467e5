"""A constant load."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene


class OffsetShift(Effect):
    """A constant load that was added or removed."""

    id = "offset_shift"
    summary = "something takes more (or less) power all the time: another device on the same supply"
    equation = "P = P_0"
    usual = "standby"
    neighbours = ("meter_gain", "thermostat", "brake_holding")
    experiment = "two minutes at rest before and after"
    structural = False
    c_body = """
    power = lanes_of(c[0]);
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1] ones."""
        return np.ones((len(scene.q), 1))

    def places(self, scene: Scene) -> Iterator[Place]:
        """The cabinet."""
        yield Place("cabinet", (0,), (Parameter("power", "W"),))
