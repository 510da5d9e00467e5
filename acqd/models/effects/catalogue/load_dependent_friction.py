"""Load-dependent gear friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Parameter, Place, Shape, per_joint
from acqd.models.effects.scene import Scene

_USUAL_SHARE = 0.2
"""Prior deviation: gears of robot joints lose 10 to 30 % of the torque that they transmit."""
_SELF_LOCKING = 1.0
"""A gear whose friction equals its load locks itself."""


class LoadDependentFriction(Effect):
    """Torque against the motion, proportional to the transmitted torque."""

    id = "load_dependent_friction"
    cause = Cause.DRY
    summary = "gear friction grows with the torque that the gear transmits"
    equation = "tau = k |tau_load| sign(qd)"
    neighbours = ("mechanical_power", "coulomb_friction", "copper_loss")
    experiment = "the same motion with and without a known payload, up and down"
    acts_on = "torque"
    c_body = """
    for (int k = 0; k < AXES; k++)
        torque[k] = c[k] * p->direction[k] * lanes_abs(p->tau_rigid[k]);
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes] W per share of the load."""
        return scene.power_per_torque * scene.direction * np.abs(scene.tau_rigid)

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints."""
        yield from per_joint(
            scene.axes, Parameter("share of the load", "-", -_SELF_LOCKING, _SELF_LOCKING, _USUAL_SHARE, whole_low=0.0)
        )
