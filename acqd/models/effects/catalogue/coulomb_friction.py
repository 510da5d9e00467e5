"""Dry friction."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import Limits
from acqd.models.effects.places import Parameter, Place, Shape, per_joint
from acqd.models.effects.scene import Scene


class CoulombFriction(Effect):
    """Torque against the direction of motion, independent of speed and load."""

    id = "coulomb_friction"
    cause = Cause.DRY
    summary = "dry friction of a gear or bearing is higher (or lower) than the model has it"
    equation = "tau = F sign(qd)"
    usual = "coulomb"
    neighbours = ("viscous_friction", "load_dependent_friction", "stribeck_friction")
    experiment = "single-joint motions at three constant speeds, both directions: dry friction does not grow with speed"
    acts_on = "torque"
    restores = ("coulomb",)
    c_body = """
    for (int k = 0; k < AXES; k++)
        torque[k] = c[k] * p->direction[k];
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes] W/Nm."""
        return scene.power_per_torque * scene.direction

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints; all of them in the proportions of the described friction, which cannot become negative."""
        known = scene.model.group("coulomb")
        most = Limits.of(scene.model).friction
        yield from per_joint(scene.axes, Parameter("torque", "Nm", -most, most), nominal=known)
