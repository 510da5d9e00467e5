"""Power of open brakes."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import LARGEST_BRAKE_W
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene


class BrakeHolding(Effect):
    """Holding current of the brake coils."""

    id = "brake_holding"
    cause = Cause.BRAKES
    summary = "power of the brake coils while the brakes are open"
    equation = "P = P_b while open"
    neighbours = ("offset_shift", "brake_release")
    experiment = "two minutes at rest with the brakes open, two with them closed"
    needs = ("brake",)
    c_body = """
    power = c[0] * p->brake;
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1] 1 while the brakes are open."""
        return scene.signals["brake"][:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """The brakes."""
        most_W = LARGEST_BRAKE_W * scene.axes
        yield Place("brakes", (0,), (Parameter("power", "W", -most_W, most_W, whole_low=0.0),))
