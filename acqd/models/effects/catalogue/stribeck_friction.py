"""Stribeck friction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import Limits
from acqd.models.effects.places import Parameter, Place, Shape, per_joint
from acqd.models.effects.scene import Scene


class StribeckFriction(Effect):
    """Additional friction near standstill that decays with speed (Stribeck curve)."""

    id = "stribeck_friction"
    cause = Cause.DRY
    summary = "extra friction near standstill that dies out with speed"
    equation = "tau = F exp(-(qd / v)^2) sign(qd)"
    neighbours = ("coulomb_friction", "clock_offset")
    experiment = "slow single-joint reversals at 1, 2, 5 and 10 % of the speed limit"
    acts_on = "torque"
    shapes = ({"speed_rad_s": 0.05}, {"speed_rad_s": 0.1}, {"speed_rad_s": 0.2}, {"speed_rad_s": 0.4})
    bounds: ClassVar = {"speed_rad_s": (0.02, 1.0)}
    c_body = """
    for (int k = 0; k < AXES; k++) {
        const lanes_t rate = p->qd[k] / speed_rad_s;
        torque[k] = c[k] * p->direction[k] * lanes_exp(-(rate * rate));
    }
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes] W/Nm."""
        return scene.power_per_torque * scene.direction * np.exp(-((scene.qd / shape["speed_rad_s"]) ** 2))

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints."""
        usual = float(np.maximum(scene.model.group("coulomb"), 0.0).mean())
        most = Limits.of(scene.model).friction
        torque = Parameter("torque", "Nm", -most, most, usual if usual > 0 else np.inf, whole_low=0.0)
        yield from per_joint(scene.axes, torque)
