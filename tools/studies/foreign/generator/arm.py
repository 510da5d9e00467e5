"""A serial arm: geometry and drives from a description file, and the true arm, which differs from the description.

The file is read as data (TOML). Only geometry and limits are taken as they are; masses, centres of mass, tensors,
rotors and windings of the true arm are drawn around the described ones.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
DESCRIPTIONS = Path(__file__).resolve().parents[4] / "acqd" / "robot" / "descriptions"
_COM_SHIFT_M = 0.008
"""Deviation of the true centre of mass on each axis."""


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body that is fixed to a link."""

    link: int
    """Counted from 0."""
    mass: float
    """kg."""
    centre: Floats
    """[3] m, centre of mass in the link's frame."""
    tensor: Floats
    """[3, 3] kg m^2 about the centre of mass, axes parallel to the link's."""


@dataclass(frozen=True, slots=True)
class Arm:
    """Geometry, bodies and drives; n joints."""

    name: str
    offset: Floats
    """[n, 3] m, joint origin in the frame of the link before."""
    turn: Floats
    """[n, 3, 3], joint frame in the frame of the link before at angle 0."""
    axis: Floats
    """[n, 3] unit vectors in the joint frame."""
    bodies: tuple[Body, ...]
    flange: Floats
    """[3] m in the last link's frame."""
    flange_turn: Floats
    """[3, 3]."""
    rotor: Floats
    """[n] kg m^2 at the gear's output."""
    torque_per_ampere: Floats
    """[n] Nm/A at the gear's output."""
    resistance: Floats
    """[n] Ohm."""
    lower: Floats
    """[n] rad."""
    upper: Floats
    """[n] rad."""
    speed: Floats
    """[n] rad/s."""
    acceleration: Floats
    """[n] rad/s^2."""
    torque: Floats
    """[n] Nm, rated."""

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.axis)


def described(name: str) -> Arm:
    """The arm of the description file `name`.toml."""
    data = tomllib.loads((DESCRIPTIONS / f"{name}.toml").read_text())
    joints = data["joint"]
    drives = [joint["drive"] for joint in joints]
    flange = data["flange"]
    return Arm(
        name,
        offset=np.array([joint["xyz"] for joint in joints], float),
        turn=np.array([_rotation(joint.get("rpy_deg", (0, 0, 0))) for joint in joints]),
        axis=np.array([joint["axis"] for joint in joints], float),
        bodies=tuple(_body(k, joint["link"]) for k, joint in enumerate(joints)),
        flange=np.array(flange["xyz"], float),
        flange_turn=_rotation(flange.get("rpy_deg", (0, 0, 0))),
        rotor=np.array([drive["rotor_inertia_kgm2"] for drive in drives], float),
        torque_per_ampere=np.array([drive["torque_constant_Nm_A"] * drive["gear_ratio"] for drive in drives]),
        resistance=np.array([drive["resistance_Ohm"] for drive in drives], float),
        lower=np.radians([joint["limits_deg"][0] for joint in joints]),
        upper=np.radians([joint["limits_deg"][1] for joint in joints]),
        speed=np.radians([joint["speed_deg_s"] for joint in joints]),
        acceleration=np.radians([joint["acceleration_deg_s2"] for joint in joints]),
        torque=np.array([joint["torque_Nm"] for joint in joints], float),
    )


def true_arm(arm: Arm, random: np.random.Generator) -> Arm:
    """An arm whose masses and tensors are 10 to 20 % off the described ones, with other rotors and windings."""
    n = arm.joints
    bodies = []
    for body in arm.bodies:
        scale = 1 + random.choice([-1, 1]) * random.uniform(0.1, 0.2)
        shift = random.normal(0, _COM_SHIFT_M, 3)
        bodies.append(Body(body.link, body.mass * scale, body.centre + shift, body.tensor * scale))
    return replace(
        arm,
        bodies=tuple(bodies),
        rotor=arm.rotor * random.uniform(0.8, 1.2, n),
        torque_per_ampere=arm.torque_per_ampere * random.uniform(0.94, 1.06, n),
        resistance=arm.resistance * random.uniform(0.8, 1.5, n),
    )


def point_mass(link: int, centre: Floats) -> Body:
    """1 kg at a point of a link, with the tensor of a ball of 3 cm radius."""
    return Body(link, 1.0, centre, np.eye(3) * 0.4 * 0.03**2)


def _body(link: int, entry: dict[str, Any]) -> Body:
    xx, yy, zz, xy, xz, yz = entry["inertia"]
    turn = _rotation(entry.get("inertia_rpy_deg", (0, 0, 0)))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float)
    return Body(link, float(entry["mass"]), np.array(entry["com"], float), turn @ tensor @ turn.T)


def _rotation(rpy_deg: Any) -> Floats:
    """Rotation matrix of fixed-axis roll, pitch and yaw."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.radians(rpy_deg)), np.sin(np.radians(rpy_deg))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
