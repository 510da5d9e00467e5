"""Friction of cold gears."""

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


class ThermalFriction(Effect):
    """Viscous friction that decays while the gears warm up.

    Time counts from the first recording of the session, and what the robot had worked before that; how long the arm
    worked between recordings is unknown.
    """

    id = "thermal_friction"
    cause = Cause.COLD
    summary = "friction of cold gears that falls while the arm works"
    equation = "tau = D exp(-t_moving / T) qd"
    usual = "viscous"
    neighbours = ("viscous_friction",)
    experiment = "the same motion every five minutes from a cold start, with gear temperatures if the robot logs them"
    acts_on = "torque"
    follows_clock = True
    exported = False
    omitted_because = "an FMU assumes warm gears"
    shapes = ({"minutes": 4.0}, {"minutes": 8.0}, {"minutes": 16.0}, {"minutes": 32.0})
    bounds: ClassVar = {"minutes": (2.0, 90.0)}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes] W per Nm s/rad of a cold gear; 0 without a session start in the scene's memory."""
        age_s = np.maximum(scene.t - scene.memory.get("origin_s", -np.inf), 0.0) + scene.memory.get("worked_s", 0.0)
        decay = np.exp(-age_s / (60 * shape["minutes"]))[:, None]
        return np.asarray(scene.power_per_torque * scene.qd * decay)

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints; all of them in the proportions of the described friction, which cannot become negative."""
        known = scene.model.group("viscous")
        most = Limits.of(scene.model).viscous
        cold = Parameter("cold coefficient", "Nm s/rad", -most, most, whole_low=0.0)
        yield from per_joint(scene.axes, cold, nominal=known)
