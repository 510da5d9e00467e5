"""What power is spent on: the groups into which the power of a model is split."""

from __future__ import annotations

from enum import StrEnum


class Cause(StrEnum):
    """A cause of power at the mains, in the order of tables and pictures."""

    STANDBY = "standby"
    GRAVITY = "potential energy"
    ACCELERATION = "kinetic energy"
    DRY = "dry friction"
    VISCOUS = "viscous friction"
    COLD = "cold friction"
    COPPER = "copper"
    DRIVES = "drives and supply"
    BRAKES = "brakes"
    TOOL = "tool"
    LOAD = "load on the arm"
    BURNT = "burnt while braking"
    OTHER = "other loads"
    METER = "meter and clocks"
    """No consumption: what the meter shows differs from what the robot takes."""
    UNNAMED = "without a name"
    """Laws without a name, and the network of a hybrid model."""

    @property
    def stored(self) -> bool:
        """Energy that the arm has, and gives back over a closed motion: no consumption of a year."""
        return self in (Cause.GRAVITY, Cause.ACCELERATION)
