"""A joint of a robot description with its drive and its link. A prismatic joint writes metres, newtons, kilograms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AliasChoices, Field, field_validator, model_validator

from acqd.robot.section import Section
from acqd.section import ARRAY

Vector = Annotated[tuple[float, float, float], ARRAY]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Kind = Literal["revolute", "prismatic"]
UNITS = {
    "limits": ("limits_deg", "limits_m"),
    "speed": ("speed_deg_s", "speed_m_s"),
    "acceleration": ("acceleration_deg_s2", "acceleration_m_s2"),
    "effort": ("torque_Nm", "force_N"),
}
"""Keys of a revolute and of a prismatic joint, by attribute."""
DRIVE_UNITS = {"gear_ratio": ("gear_ratio", "gear_ratio_rad_m"), "rotor": ("rotor_inertia_kgm2", "rotor_mass_kg")}
FRICTION_UNITS = {"coulomb": ("coulomb_Nm", "coulomb_N"), "viscous": ("viscous_Nms_rad", "viscous_Ns_m")}


_ROUNDING = 0.01  # of the largest moment: published tensors are rounded


def has_negative_moment(six: Sequence[float]) -> bool:
    """Whether a tensor xx, yy, zz, xy, xz, yz has a principal moment below zero by more than rounding."""
    xx, yy, zz, xy, xz, yz = six
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return bool(moments[0] < -_ROUNDING * max(abs(moments[2]), 1e-9))


def _either(keys: tuple[str, str]) -> Any:
    return Field(validation_alias=AliasChoices(*keys))


class Capsule(Section):
    """A cylinder with round ends, in the frame of its link."""

    radius: Positive
    """m."""
    start: Annotated[Vector, Field(alias="from")]
    """m."""
    end: Annotated[Vector, Field(alias="to")]
    """m."""


class Link(Section):
    """Inertial parameters of the body that a joint moves."""

    mass: Positive
    """kg."""
    com: Vector
    """Centre of mass in the link frame [m]."""
    inertia: Annotated[tuple[float, float, float, float, float, float], ARRAY]
    """xx, yy, zz, xy, xz, yz at the centre of mass [kg m^2]."""
    inertia_rpy_deg: Vector = (0.0, 0.0, 0.0)
    """Orientation of the axes of `inertia` in the link frame."""

    @field_validator("inertia")
    @classmethod
    def _of_a_body(cls, inertia: tuple[float, ...]) -> tuple[float, ...]:
        if has_negative_moment(inertia):
            raise ValueError("xx, yy, zz, xy, xz, yz have a negative principal moment, which no body has")
        return inertia


class Drive(Section):
    """Motor and gear, as far as they are known."""

    gear_ratio: Annotated[Positive, _either(DRIVE_UNITS["gear_ratio"])]
    """Motor angle per joint angle; of a prismatic joint rad of the motor per m (`gear_ratio_rad_m`)."""
    rotor_inertia_kgm2: Annotated[NotNegative, _either(DRIVE_UNITS["rotor"])]
    """Rotor inertia reflected to the gear's output; of a prismatic joint kg (`rotor_mass_kg`)."""
    torque_constant_Nm_A: Positive
    """Torque constant of the motor, before the gear."""
    resistance_Ohm: Positive
    """Effective resistance: R i^2 is the whole copper loss."""

    @property
    def effort_per_ampere(self) -> float:
        """Gain K from motor current to effort at the joint: Nm/A, or N/A of a prismatic joint."""
        return self.gear_ratio * self.torque_constant_Nm_A


class Friction(Section):
    """Friction at the gear's output, where it is known."""

    coulomb: Annotated[NotNegative, _either(FRICTION_UNITS["coulomb"])]
    """Nm (`coulomb_Nm`), or N (`coulomb_N`)."""
    viscous: Annotated[NotNegative, _either(FRICTION_UNITS["viscous"])]
    """Nm s/rad (`viscous_Nms_rad`), or N s/m (`viscous_Ns_m`)."""


class Joint(Section):
    """A joint and its link. `xyz` and `rpy_deg` (URDF) place its frame in the frame of the joint before."""

    name: str
    kind: Kind = "revolute"
    xyz: Vector
    """m."""
    rpy_deg: Vector = (0.0, 0.0, 0.0)
    axis: Vector
    limits: Annotated[tuple[float, float], ARRAY, _either(UNITS["limits"])]
    """deg, or m."""
    speed: Annotated[Positive, _either(UNITS["speed"])]
    """deg/s, or m/s."""
    acceleration: Annotated[Positive, _either(UNITS["acceleration"])]
    """Acceleration at 100 %: deg/s^2, or m/s^2."""
    effort: Annotated[Positive, _either(UNITS["effort"])]
    """Greatest torque or force at the joint: Nm, or N."""
    drive: Drive
    friction: Friction | None = None
    link: Link
    capsules: list[Capsule] = Field(default=[])
    guessed: list[str] = Field(default=[])
    """Keys of this joint whose values nobody has published or measured: `drive`, `drive.resistance_Ohm` ..."""

    @model_validator(mode="before")
    @classmethod
    def _keys_of_its_kind(cls, table: Any) -> Any:
        """The keys carry units, and the units depend on the kind; a guessed key must exist."""
        if isinstance(table, dict):
            kind = table.get("kind", "revolute")
            _require_keys(table, UNITS, kind, required=True)
            for name, units in (("drive", DRIVE_UNITS), ("friction", FRICTION_UNITS)):
                if isinstance(table.get(name), dict):
                    _require_keys(table[name], units, kind, required=True, prefix=f"{name}.")
            _require_guesses(table)
        return table

    @field_validator("axis")
    @classmethod
    def _has_direction(cls, axis: Vector) -> Vector:
        if not any(axis):
            raise ValueError("an axis needs a direction")
        return axis

    @field_validator("limits")
    @classmethod
    def _ordered(cls, limits: tuple[float, float]) -> tuple[float, float]:
        if not limits[0] < limits[1]:
            raise ValueError("expected [lower, upper]")
        return limits

    @property
    def slides(self) -> bool:
        """Whether the joint is prismatic."""
        return self.kind == "prismatic"

    @property
    def torque_Nm(self) -> float:  # noqa: N802 (the unit's name)
        """The effort: Nm, or N of a prismatic joint."""
        return self.effort

    def si(self, value: float) -> float:
        """A position, speed or acceleration of the file in rad, or in m."""
        return value if self.slides else math.radians(value)

    def is_guessed(self, key: str) -> bool:
        """Whether `key` (such as `drive.resistance_Ohm`), or the table that holds it, is marked as guessed."""
        return key in self.guessed or key.partition(".")[0] in self.guessed

    @property
    def guesses_drive(self) -> bool:
        """Whether nobody has published or measured what the motor's current does at the joint."""
        return self.is_guessed("drive.torque_constant_Nm_A")


def _require_keys(
    table: dict[str, Any], units: dict[str, tuple[str, str]], kind: str, *, required: bool, prefix: str = ""
) -> None:
    """Raises ValueError for a key of the other kind, or for a missing key."""
    right = 1 if kind == "prismatic" else 0
    for name, keys in units.items():
        here, other = keys[right], keys[1 - right]
        if other != here and other in table:
            raise ValueError(f"{prefix}{other} is no key of a {kind} joint; write {prefix}{here}")
        if required and here not in table and name not in table:
            raise ValueError(f"{prefix}{here} is missing")


def _require_guesses(table: dict[str, Any]) -> None:
    guessed = table.get("guessed", [])
    for path in guessed if isinstance(guessed, list) else []:
        at: Any = table
        for key in str(path).split("."):
            at = at.get(key) if isinstance(at, dict) else None
        if at is None:
            raise ValueError(f"guessed names {path!r}, which is no key of this joint")
