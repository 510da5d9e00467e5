"""The largest sizes that physics permits: limits of the effects' parameters, from the arm and from general knowledge.

Limits are wide. They exclude what no robot does, so that a fit cannot win by two impossible sizes that cancel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.bodies import GRAVITY
from acqd.models.greybox.model import GreyBox

LARGEST_LOAD_W = 22e3
"""Three phases of 400 V and 32 A: the largest usual socket."""
LARGEST_TOOL_W = 5e3
"""Electric spindles and grippers at a flange."""
LARGEST_BRAKE_W, LARGEST_INRUSH_W = 50.0, 500.0
"""Of a joint: coils of holding brakes take 10 to 30 W; inrush of coil and motor for some ms."""
LARGEST_OFFSET_S = 1.0
"""Recordings farther apart are not aligned at all."""
LARGEST_DRIFT_S_H = 1.8
"""500 ppm: clocks of computers are slewed no faster (adjtimex(2)), and quartzes drift by less."""
LEAST_EXPONENT, LARGEST_EXPONENT = -1.0, 5.0
"""Of the voltage: -1 for a current of constant power, 2 for a resistor, up to 5 for a saturating core."""
LEAST_GAIN, LARGEST_GAIN = -1.0, 9.0
"""A meter that reads nothing, and one with a transformer of ten times the ratio."""
LARGEST_LOSS_W = 50.0
"""Of a supply that delivers 100 W: an efficiency of 67 %."""
_PAYLOADS = 2.0
"""Mass that an arm carries, over its own: the strongest light arms carry as much as they weigh."""
_LEAST_KG = 1e-3
"""Where a fit to motion that tells no masses has left the arm none: what it carries stays a size above zero."""
_ONE_METRE = 1.0
_SLIDING_G = 10.0
"""Acceleration in units of gravity with which no slide moves the machine."""
_RIPPLE = 0.25
"""Share of an arm's static torque with which no gear ripples."""
_SLOW = 0.1
"""rad/s or m/s at which a friction proportional to the speed may reach the largest torque."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The largest sizes at one arm."""

    arm_kg: float
    """Mass that moves."""
    reach_m: float
    """Of the stretched arm with its flange, at least."""
    torque: Floats
    """[axes] Nm (N of prismatic joints) of the arm stretched out, and a payload as heavy as it."""

    @classmethod
    def of(cls, model: GreyBox) -> Limits:
        """The limits of a grey box's arm."""
        lengths = np.linalg.norm(model.chain.xyz, axis=1)
        arm_kg = max(float(np.abs(model.group("inertial")[::10]).sum()), _LEAST_KG)
        reach_m = max(float(lengths[1:].sum() + np.linalg.norm(model.chain.tip[0])), 0.05)
        torque = np.full(model.axes, 2 * arm_kg * GRAVITY * reach_m)
        torque[list(model.layout.sliding)] = arm_kg * GRAVITY * _SLIDING_G
        return cls(arm_kg, reach_m, np.maximum(torque, 1e-3))

    @property
    def payload_kg(self) -> float:
        """The heaviest body that the arm carries."""
        return _PAYLOADS * self.arm_kg

    @property
    def moment_kg_m(self) -> float:
        """First moment of such a body beside an axis."""
        return self.payload_kg * max(self.reach_m, _ONE_METRE)

    @property
    def lifting_force(self) -> float:
        """N that lift the arm with its payload: no contact is harder."""
        return (self.arm_kg + self.payload_kg) * GRAVITY

    @property
    def friction(self) -> float:
        """Nm or N of any joint."""
        return float(self.torque.max())

    @property
    def viscous(self) -> float:
        """Nm s/rad or N s/m of any joint."""
        return self.friction / _SLOW

    @property
    def copper(self) -> float:
        """W/Nm^2 of any joint: the largest load, at a hundredth of the largest torque."""
        return LARGEST_LOAD_W / (0.01 * float(self.torque.min())) ** 2

    def ripple(self, joint: int) -> float:
        """Nm or N at a joint (from 0)."""
        return _RIPPLE * float(self.torque[joint])
