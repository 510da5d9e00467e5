"""Viscous friction."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import Limits
from acqd.models.effects.places import Parameter, Place, Shape, per_joint
from acqd.models.effects.scene import Scene


class ViscousFriction(Effect):
    """Torque against the motion, proportional to speed."""

    id = "viscous_friction"
    cause = Cause.VISCOUS
    summary = "friction that grows with speed is higher (or lower): another grease, another temperature"
    equation = "tau = D qd"
    usual = "viscous"
    neighbours = ("thermal_friction", "coulomb_friction", "copper_loss")
    experiment = "the same motion at three speeds, without load, once cold and once after half an hour of work"
    acts_on = "torque"
    restores = ("viscous",)
    c_body = """
    for (int k = 0; k < AXES; k++)
        torque[k] = c[k] * p->qd[k];
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes] W per Nm s/rad."""
        return scene.power_per_torque * scene.qd

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints; all of them in the proportions of the described friction, which cannot become negative."""
        known = scene.model.group("viscous")
        most = Limits.of(scene.model).viscous
        yield from per_joint(scene.axes, Parameter("coefficient", "Nm s/rad", -most, most), nominal=known)
