"""How much of the predicted power hangs on each value of a description: a one-at-a-time study of the grey box.

Power is that of the model that `acqd train` starts from, with the described values and no standby power.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import Layout, prior
from acqd.robot.description import Joint, RobotDescription
from acqd.robot.inertia import inertial_parameters
from acqd.robot.joint import DRIVE_UNITS, FRICTION_UNITS
from acqd.robot.newton_euler import Chain
from acqd.robot.urdf.defaults import Rated, guessed_friction
from acqd.robot_check.excitation import STEP_S, excitation

GUESSED_FACTOR = 2.0
"""Values that nobody has measured: the shipped descriptions scatter by 1.8 (rotors) to 2.2 (copper loss)."""
KNOWN_FACTOR = 1.1
"""Published values; links of one robot differ by up to 25 % between sources."""


@dataclass(frozen=True, slots=True)
class Influence:
    """What one value means for the power."""

    joint: str
    key: str
    value: float
    """As in the file."""
    unit: str
    guessed: bool
    factor: float
    """The value times this factor, and divided by it, is compared."""
    change_W: float
    """RMS change of the power, the larger of both."""


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Power over the excitation, and the influences on it, largest first."""

    mean_W: float
    deviation_W: float
    """Standard deviation of the predicted power."""
    peak_W: float
    influences: list[Influence]


def sensitivity(robot: RobotDescription) -> Sensitivity:
    """Vary every mass, drive and friction value by its factor over 60 s of motion within the described limits."""
    q = excitation(robot)
    base = _power(robot, q)
    found = [
        Influence(joint.name, key, value, unit, guessed, factor, _change(base, robot, k, key, factor, q))
        for k, joint in enumerate(robot.joint)
        for key, value, unit, guessed, factor in _values(joint, float(robot.speed[k]))
    ]
    found.sort(key=lambda each: -each.change_W)
    return Sensitivity(float(base.mean()), float(base.std()), float(base.max()), found)


def _values(joint: Joint, speed: float) -> Iterator[tuple[str, float, str, bool, float]]:
    """Key, value, unit, guessed or not, and factor of what is varied at a joint."""
    slides = int(joint.slides)
    rotor, torque = DRIVE_UNITS["rotor"][slides], ("Nm", "N")[slides]
    coulomb, viscous = (FRICTION_UNITS[name][slides] for name in ("coulomb", "viscous"))
    drive, friction = joint.drive, _friction(joint, speed)
    rows = [
        ("link.mass", joint.link.mass, "kg"),
        (f"drive.{rotor}", drive.rotor_inertia_kgm2, ("kg m^2", "kg")[slides]),
        ("drive.torque_constant_Nm_A", drive.torque_constant_Nm_A, "Nm/A"),
        ("drive.resistance_Ohm", drive.resistance_Ohm, "Ohm"),
        (f"friction.{coulomb}", friction[0], torque),
        (f"friction.{viscous}", friction[1], ("Nm s/rad", "N s/m")[slides]),
    ]
    for key, value, unit in rows:
        guessed = joint.is_guessed(key) or (key.startswith("friction") and joint.friction is None)
        yield key, value, unit, guessed, GUESSED_FACTOR if guessed else KNOWN_FACTOR


def _friction(joint: Joint, speed: float) -> tuple[float, float]:
    """Coulomb and viscous friction, as described or by share of the rated effort."""
    if joint.friction is not None:
        return joint.friction.coulomb, joint.friction.viscous
    coulomb, viscous = guessed_friction(Rated(joint.effort, speed), joint.kind).values()
    return coulomb, viscous


def _change(base: Floats, robot: RobotDescription, k: int, key: str, factor: float, q: Floats) -> float:
    changes = [_power(robot, q, k, key, each) - base for each in (factor, 1 / factor)]
    return max(float(np.sqrt((change**2).mean())) for change in changes)


def _power(robot: RobotDescription, q: Floats, k: int = 0, key: str = "", factor: float = 1.0) -> Floats:
    """Power [T - 2] W of a motion, with the value `key` of joint `k` times `factor`."""
    layout = Layout(robot.axes, (), robot.sliding)
    values = prior(layout, robot, inertial_parameters(robot), 0.0, STEP_S).mean
    friction = np.array([_friction(joint, speed) for joint, speed in zip(robot.joint, robot.speed, strict=True)])
    values[layout.part("coulomb")], values[layout.part("viscous")] = friction.T
    group = key.partition(".")[2].partition("_")[0]
    if group == "mass":
        values[layout.part("inertial")][10 * k : 10 * k + 10] *= factor
    elif group in ("rotor", "coulomb", "viscous"):
        values[layout.part(group)][k] *= factor
    elif group in ("torque", "resistance"):
        values[layout.part("copper")][k] *= factor if group == "resistance" else factor**-2
    return GreyBox(Chain.of(robot), layout, values, STEP_S).run(q, np.zeros((len(q) - 2, 0)))
