"""Clipping of the current channel."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene


class MeterSaturation(Effect):
    """Power above a ceiling is missing; the ceiling is a multiple of the standby power."""

    id = "meter_saturation"
    cause = Cause.METER
    summary = "power above a ceiling is missing: the current range is too small"
    equation = "P = -s max(P_model - L, 0)"
    neighbours = ("supply_efficiency", "meter_gain")
    experiment = "look at the waveform's peaks, or choose the next current range"
    acts_on = "meter"
    structural = False
    shapes = tuple({"ceiling_of_standby": ceiling} for ceiling in (1.1, 1.2, 1.3, 1.4, 1.55, 1.7, 2.0, 2.4, 2.9, 3.5))
    bounds: ClassVar = {"ceiling_of_standby": (1.0, 6.0)}
    c_body = """
    power = -c[0] * fmax(predicted - ceiling_of_standby * CARRIER.standby, 0.0);
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[T, 1] W above the ceiling, negative."""
        ceiling = shape["ceiling_of_standby"] * float(scene.model.group("standby")[0])
        return -np.maximum(scene.predicted - ceiling, 0.0)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """The meter."""
        yield Place("meter", (0,), (Parameter("share lost above", "-", 0.0, 1.3),))
