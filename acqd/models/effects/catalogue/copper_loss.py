"""Loss in the motors' windings."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import Limits
from acqd.models.effects.places import Parameter, Place, Shape, per_joint
from acqd.models.effects.scene import Scene


class CopperLoss(Effect):
    """Loss proportional to the square of the motor torque."""

    id = "copper_loss"
    cause = Cause.COPPER
    summary = "the motors' windings lose more (or less) power than the model has it: warmer, or damaged"
    equation = "P = R sum(c tau^2)"
    usual = "copper"
    neighbours = ("payload", "viscous_friction", "supply_efficiency")
    experiment = "hold the arm stretched out for a minute, with and without a payload"
    restores = ("copper", "conduction")
    c_body = """
    for (int k = 0; k < AXES; k++)
        power += c[k] * p->tau[k] * p->tau[k];
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes] Nm^2."""
        return scene.tau**2

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints; all of them in the proportions of the described loss."""
        most = Limits.of(scene.model).copper
        yield from per_joint(scene.axes, Parameter("loss", "W/Nm^2", -most, most), nominal=scene.model.group("copper"))
