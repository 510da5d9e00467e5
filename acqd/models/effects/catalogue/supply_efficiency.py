"""Loss of the power supply."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import LARGEST_LOSS_W
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene

_USUAL_LOSS_W = 10.0
"""Prior deviation of the loss at 100 W: supplies are 80 to 95 % efficient."""


class SupplyEfficiency(Effect):
    """Loss proportional to the square of the supply's load; a share of the standby power is on another supply."""

    id = "supply_efficiency"
    cause = Cause.DRIVES
    summary = "the power supply loses more the harder it works"
    equation = "P = a (P_load / 100 W)^2"
    neighbours = ("meter_gain", "copper_loss")
    experiment = "rest, a slow motion and a fast one, each for a minute: the loss grows with the square"
    shapes = tuple({"standby_elsewhere": share} for share in (0.0, 0.5, 0.8, 1.0))
    bounds: ClassVar = {"standby_elsewhere": (0.0, 1.0)}
    c_body = """
    const lanes_t load = lanes_max(p->drives + CARRIER.standby * (1.0 - standby_elsewhere), lanes_of(0.0)) / 100.0;
    power = c[0] * load * load;
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1] square of the load over 100 W."""
        standby = float(scene.model.group("standby")[0])
        load = np.maximum(scene.drives + standby * (1 - shape["standby_elsewhere"]), 0.0)
        return ((load / 100) ** 2)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """The supply."""
        yield Place("supply", (0,), (Parameter("loss at 100 W", "W", 0.0, LARGEST_LOSS_W, _USUAL_LOSS_W),))
