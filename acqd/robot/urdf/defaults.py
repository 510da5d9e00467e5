"""Values that a URDF does not hold, as shares of a joint's rated effort and speed.

The shares are rounded geometric means over the joints of the shipped ur3e, ur10e, kinova_gen3 and iiwa7_r800
(friction: of their plant files in acqd.lab.plants); a test compares. All six are ratios, so that one set serves
torques and forces.
"""

from __future__ import annotations

from dataclasses import dataclass

from acqd.robot.joint import DRIVE_UNITS, FRICTION_UNITS, UNITS

RAMP_S = 0.21
"""Seconds from standstill to rated speed."""
ROTOR_SHARE = 0.14
"""Share of the rated effort that accelerates the rotor at full acceleration."""
COPPER_SHARE = 0.16
"""Copper loss at rated effort per rated mechanical power."""
COULOMB_SHARE, VISCOUS_SHARE = 0.057, 0.19
"""Coulomb friction, and viscous friction at rated speed, per rated effort."""
PLAUSIBLE_FRICTION = (0.01, 0.6)
"""Friction at rated speed per rated effort: outside, a URDF's <dynamics> is a simulator's setting."""
GRAVITY_MARGIN = 3.0
"""Rated effort per greatest effort that holds the arm, where a URDF gives none."""
_GEAR_RATIO = 100.0  # strain wave gears of arms have 50 to 160
_SCREW_RAD_M = 314.0  # a ball screw with a lead of 20 mm per turn
_TORQUE_CONSTANT = 0.08  # Nm/A before the gear; 0.035 to 0.108 in the shipped descriptions
SPEED = {"revolute": 90.0, "prismatic": 0.5}
"""deg/s and m/s."""


@dataclass(frozen=True, slots=True)
class Rated:
    """What a joint can do, in SI units."""

    effort: float
    """Nm or N."""
    speed: float
    """rad/s or m/s."""

    @property
    def acceleration(self) -> float:
        """rad/s^2 or m/s^2."""
        return self.speed / RAMP_S


def key(name: str, kind: str) -> str:
    """The key of an attribute for a kind of joint: `effort` of a slide is `force_N`."""
    return (UNITS | DRIVE_UNITS | FRICTION_UNITS)[name][kind == "prismatic"]


def guessed_drive(rated: Rated, kind: str, acceleration: float | None = None) -> dict[str, float]:
    """A drive as a table of a description. `acceleration` in SI units, where it is known."""
    ratio = _SCREW_RAD_M if kind == "prismatic" else _GEAR_RATIO
    copper_W = COPPER_SHARE * rated.effort * rated.speed
    return {
        key("gear_ratio", kind): ratio,
        key("rotor", kind): _short(ROTOR_SHARE * rated.effort / (acceleration or rated.acceleration)),
        "torque_constant_Nm_A": _TORQUE_CONSTANT,
        "resistance_Ohm": _short(copper_W * (ratio * _TORQUE_CONSTANT / rated.effort) ** 2),
    }


def guessed_friction(rated: Rated, kind: str) -> dict[str, float]:
    """Friction as a table of a description."""
    return {
        key("coulomb", kind): _short(COULOMB_SHARE * rated.effort),
        key("viscous", kind): _short(VISCOUS_SHARE * rated.effort / rated.speed),
    }


def _short(value: float) -> float:
    return float(f"{value:.3g}")
