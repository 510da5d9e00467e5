"""Mechanical power lost or missing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Parameter, Place, Shape, per_joint
from acqd.models.effects.scene import Scene

_USUAL_LOSS = 0.2
"""Gears of robot joints lose 10 to 30 % of the power that they transmit."""
_LEAST_LOSS = -0.05
"""A loss cannot be negative; less than the model's friction can be lost by some percent."""
_SELF_LOCKING = 1.0
"""A gear that loses as much as it transmits locks itself (efficiency of one half): robots have no such gears."""
_WHOLE = 1.2
"""Net mechanical power that a model can lack, or have too much of: all of it, with the error of its torques."""


class MechanicalPower(Effect):
    """A share of the mechanical power: lost in the gear, net, or lost outside the motor."""

    id = "mechanical_power"
    cause = Cause.DRIVES
    summary = "a share of the mechanical power is lost in the gears, or the model lacks mechanical power"
    equation = "P = a sum(|tau qd|) + b sum(tau qd)"
    neighbours = ("load_dependent_friction", "viscous_friction", "meter_gain")
    experiment = "lift and lower a known payload at two speeds: losses have one sign, mechanical power two"
    restores = ("gain",)
    c_body = """
    for (int k = 0; k < AXES; k++) {
        const lanes_t product = p->tau[k] * p->qd[k];
        power += c[k] * p->power_per_torque[k] * lanes_abs(p->tau[k]) * p->direction[k];
        power += c[AXES + k] * product + c[2 * AXES + k] * lanes_abs(product);
    }
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 3 axes] W per share: |tau qd| as a torque with its copper loss; tau qd; |tau qd| without copper loss."""
        lost = scene.power_per_torque * np.abs(scene.tau) * scene.direction
        return np.column_stack([lost, scene.tau * scene.qd, np.abs(scene.tau * scene.qd)])

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints, for losses in the gear, net power, and losses outside the motor."""
        lost = Parameter("lost share", "-", _LEAST_LOSS, _SELF_LOCKING, deviation=_USUAL_LOSS)
        yield from per_joint(scene.axes, lost)
        net = Parameter("share", "-", -_WHOLE, _WHOLE, deviation=1.0)
        yield from per_joint(scene.axes, net, scene.axes)
        yield from per_joint(scene.axes, replace(lost, name="share lost beside the motor"), 2 * scene.axes)
