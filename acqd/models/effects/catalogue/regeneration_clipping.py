"""Braking power in a resistor."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene


class RegenerationClipping(Effect):
    """Power returned by the drives above a threshold is dissipated in the brake resistor."""

    id = "regeneration_clipping"
    cause = Cause.BURNT
    summary = "power that the drives give back while braking is burnt instead of used"
    equation = "P = s max(-P_drives - P_0, 0)"
    neighbours = ("supply_efficiency", "mechanical_power")
    experiment = "lower a heavy payload fast, again and again"
    of_drives = True
    shapes = ({"above_W": 0.0}, {"above_W": 10.0}, {"above_W": 25.0}, {"above_W": 50.0})
    bounds: ClassVar = {"above_W": (0.0, 200.0)}
    c_body = """
    power = c[0] * lanes_max(-p->drives - above_W, lanes_of(0.0));
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1] W."""
        return np.maximum(-scene.drives - shape["above_W"], 0.0)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """The DC link."""
        yield Place("DC link", (0,), (Parameter("share", "-", 0.0, 1.5),))
