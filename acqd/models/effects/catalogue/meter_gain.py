"""Gain error of the meter."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import LARGEST_GAIN, LEAST_GAIN
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene

_USUAL_ERROR = 0.1
"""Prior deviation of a gain error: transformers of class 1, or a burden that is not theirs."""


class MeterGain(Effect):
    """The meter reads a share too much, or too little."""

    id = "meter_gain"
    cause = Cause.METER
    summary = "everything measured is off by the same share: the current transformer or its setting"
    equation = "P = g P_model"
    neighbours = ("supply_efficiency", "offset_shift")
    experiment = "compare with a second meter at rest and under load"
    acts_on = "meter"
    structural = False
    c_body = """
    power = c[0] * predicted;
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[T, 1] W: the predicted power."""
        return scene.predicted[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """The meter."""
        yield Place("meter", (0,), (Parameter("gain error", "-", LEAST_GAIN, LARGEST_GAIN, _USUAL_ERROR),))
