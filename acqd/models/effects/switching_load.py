"""A load that is on or off at times which only the residual shows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import LARGEST_LOAD_W
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox


class SwitchingLoad(Effect):
    """Base class of loads in the cabinet that switch; a model holds the mean, because the times are unknown."""

    predictable = False
    structural = False
    c_body = """
    power = lanes_of(c[0] * share_of_time);
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1] the share of time in which the load is on; no columns without a shape."""
        if not shape:
            return np.zeros((len(scene.q), 0))
        return np.full((len(scene.q), 1), shape["share_of_time"])

    def places(self, scene: Scene) -> Iterator[Place]:
        """No places before detection."""
        return iter(())

    def detected_place(self, shape: Shape, model: GreyBox) -> Place:
        """The cabinet."""
        return Place("cabinet", (0,), (Parameter("power", "W", 0.0, LARGEST_LOAD_W),))

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Share of the time in which the load is on."""
        return {"share_of_time": float(shape["share_of_time"])}
