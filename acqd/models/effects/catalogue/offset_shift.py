"""A constant load."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import LARGEST_LOAD_W
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene

_STANDBY_ERROR_W = 5.0
"""Of the fitted standby power: a removed load takes no more than that."""


class OffsetShift(Effect):
    """A constant load that was added or removed."""

    id = "offset_shift"
    cause = Cause.OTHER
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
        standby_W = max(float(scene.model.group("standby")[0]), 0.0)
        yield Place("cabinet", (0,), (Parameter("power", "W", -standby_W - _STANDBY_ERROR_W, LARGEST_LOAD_W),))
