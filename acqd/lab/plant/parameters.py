"""Parameters of the plant: one TOML file per robot in `acqd/lab/plants`, and the random spread of the true robot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from acqd.arrays import Floats
from acqd.errors import InputError, UserError
from acqd.robot.description import Joint, RobotDescription, Section, read_toml

_FOLDER = Path(__file__).parent.parent / "plants"
_Positive = Annotated[float, Field(gt=0)]
_NotNegative = Annotated[float, Field(ge=0)]


class Friction(Section):
    """Friction of gears and bearings at the output, per axis."""

    coulomb_Nm: list[_NotNegative]
    stribeck_Nm: list[_NotNegative]
    stribeck_speed_rad_s: _Positive
    viscous_Nms_rad: list[_NotNegative]
    viscous_per_K: _NotNegative
    """Relative growth of the viscous part per K below 30 degC."""


class Thermal(Section):
    """First-order heating of each gear by its friction."""

    capacity_J_K: list[_Positive]
    resistance_K_W: list[_Positive]
    ambient_degC: float


class DriveLosses(Section):
    """Losses of the inverters."""

    enabled_W: _NotNegative
    per_ampere_W: _NotNegative
    share: Annotated[float, Field(ge=0, lt=0.5)]


class DcLink(Section):
    """The DC link between supply and inverters; no power flows back to the mains."""

    electronics_W: _NotNegative
    capacitor_J: _NotNegative


class Supply(Section):
    """P_in = P_out + fixed + linear P_out + quadratic P_out^2, followed by a first-order lag."""

    fixed_W: _NotNegative
    linear: Annotated[float, Field(ge=0, lt=0.5)]
    quadratic_per_W: Annotated[float, Field(ge=0, lt=0.01)]
    lag_s: Annotated[float, Field(ge=0.001, le=1)]


class ControllerLoad(Section):
    """Standby load of the cabinet."""

    power_W: _NotNegative
    fast_fluctuation_W: _NotNegative
    """RMS, correlated over 0.15 s: work of the cabinet PC."""
    slow_fluctuation_W: _NotNegative
    """RMS, correlated over 30 s: fans and temperature."""


class PlantParameters(Section):
    """All parameters of a plant."""

    robot: str
    parameter_spread: Annotated[float, Field(ge=0, le=0.3)]
    friction: Friction
    thermal: Thermal
    drive: DriveLosses
    dc_link: DcLink
    supply: Supply
    controller: ControllerLoad


def load_plant(robot: RobotDescription, path: Path | None = None) -> PlantParameters:
    """Parameters from a file, by default the one shipped for the robot. Raises UserError or InputError."""
    path = path or _FOLDER / f"{robot.name}.toml"
    if not path.exists() and path.parent == _FOLDER:
        raise UserError(
            f"robot {robot.name} has no plant file; write one like those in {_FOLDER} and set `plant` in --settings"
        )
    parameters = read_toml(path, PlantParameters)
    per_axis = {
        "friction": ("coulomb_Nm", "stribeck_Nm", "viscous_Nms_rad"),
        "thermal": ("capacity_J_K", "resistance_K_W"),
    }
    for section, keys in per_axis.items():
        for key in keys:
            count = len(getattr(getattr(parameters, section), key))
            if count != robot.axes:
                raise InputError(path, f"{section}.{key} has {count} values, but {robot.name} has {robot.axes} axes")
    return parameters


def true_robot(robot: RobotDescription, spread: float, random: np.random.Generator) -> RobotDescription:
    """The robot as it really is: masses, centres of mass and rotors deviate randomly from the description.

    `spread` is the relative standard deviation; centres of mass shift by 0.1 m times `spread`.
    """

    def factor() -> float:
        return float(np.exp(spread * np.clip(random.standard_normal(), -2.5, 2.5)))

    def deviate(joint: Joint) -> Joint:
        scale = factor()
        shift = 0.1 * spread * np.clip(random.standard_normal(3), -2.5, 2.5)
        com = tuple(float(c) for c in np.array(joint.link.com) + shift)
        inertia = tuple(scale * value for value in joint.link.inertia)
        link = joint.link.model_copy(update={"mass": joint.link.mass * scale, "com": com, "inertia": inertia})
        drive = joint.drive.model_copy(update={"rotor_inertia_kgm2": joint.drive.rotor_inertia_kgm2 * factor()})
        return joint.model_copy(update={"link": link, "drive": drive})

    return robot.model_copy(update={"joint": [deviate(joint) for joint in robot.joint]})


def per_axis(values: list[float]) -> Floats:
    """Values [axes] as an array that broadcasts with [T, axes]."""
    return np.array(values)
