"""What in a robot description no real arm can have, or hardly has.

`wrong` contradicts physics or lets the arm fall; `doubtful` is unusual and worth a look at the source.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import central_tensor, gravity_torque
from acqd.robot.posture import Posture

_POSTURES = 400
_TRIANGLE_SLACK = 0.01
"""Relative: published tensors are rounded."""
_COM_REACH_SHARE, _COM_LEAST_M = 0.25, 0.25
"""A centre of mass farther from its link than this share of the reach (or this length) is doubtful."""
_LEAST_GYRATION = 0.001
"""Radius of gyration over the reach below which a tensor is a placeholder. Wrists have 0.02 and more."""
_HEAVIEST_KG = 5000.0
_LARGE_MARGIN = 30.0
"""Effort over holding effort of the most loaded joint; catalogue arms have 1.5 to 10."""
_HOLDS_NOTHING = 1e-6
"""Nm or N: below, gravity loads no joint, and the efforts cannot be compared with it."""
_MOST_TURNS = 10.0
"""Turns either way beyond which a limit is doubtful; positioners without a stop have limits of some turns."""
_FASTEST_DEG_S, _FASTEST_M_S = 1000.0, 10.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One remark on a description."""

    state: Literal["wrong", "doubtful"]
    where: str
    """Joint and key: `elbow.link.inertia`."""
    finding: str
    advice: str


def implausible(robot: RobotDescription) -> list[Finding]:
    """All remarks, what is wrong first."""
    found = [*_bodies(robot), *_limits(robot), *_masses(robot), *_efforts(robot), *_drives(robot)]
    return sorted(found, key=lambda each: each.state != "wrong")


def _reach(robot: RobotDescription) -> float:
    """Length of the arm from joint to joint [m], its slides drawn out."""
    origins = Posture.of(robot, np.zeros(robot.axes)).points
    travel = sum(abs(joint.limits[1] - joint.limits[0]) for joint in robot.joint if joint.slides)
    return float(np.linalg.norm(np.diff(origins[1:], axis=0), axis=1).sum()) + travel


def _bodies(robot: RobotDescription) -> Iterator[Finding]:
    joints, reach = robot.joint, _reach(robot)
    for k, joint in enumerate(joints):
        moments: Floats = np.asarray(np.linalg.eigvalsh(central_tensor(joint.link)), dtype=np.float64)
        key = f"{joint.name}.link.inertia"
        if moments[2] > (1 + _TRIANGLE_SLACK) * (moments[0] + moments[1]) + 1e-9:
            text = f"principal moments {_listed(moments)} kg m^2: no body has one that exceeds the sum of the others"
            yield Finding("wrong", key, text, "check the order xx, yy, zz, xy, xz, yz and where the tensor counts from")
        radius = float(np.sqrt(max(moments.sum(), 0.0) / 2 / joint.link.mass))
        if radius > 0.5 * reach:
            text = f"radius of gyration {radius:.3g} m in an arm of {reach:.3g} m"
            yield Finding("doubtful", key, text, "a placeholder, or g cm^2 or mm instead of kg m^2?")
        if radius < _LEAST_GYRATION * reach:
            text = f"radius of gyration {radius:.3g} m in an arm of {reach:.3g} m"
            yield Finding("doubtful", key, text, "a placeholder? A body of that mass would be a point")
        following = np.array(joints[k + 1].xyz if k + 1 < len(joints) else robot.flange.xyz)
        away = _distance(np.array(joint.link.com), following)
        if away > max(_COM_LEAST_M, _COM_REACH_SHARE * reach):
            text = f"{away:.3g} m from the line to the next joint, in an arm of {reach:.3g} m"
            yield Finding("doubtful", f"{joint.name}.link.com", text, "is it in m and in the link's own frame?")


def _limits(robot: RobotDescription) -> Iterator[Finding]:
    for joint in robot.joint:
        widest = max(abs(limit) for limit in joint.limits)
        if not joint.slides and widest > _MOST_TURNS * 360.0:
            text = f"turns up to {widest:.5g} deg, {widest / 360:.0f} turns"
            yield Finding("doubtful", f"{joint.name}.limits_deg", text, "were degrees in a URDF taken for rad?")


def _masses(robot: RobotDescription) -> Iterator[Finding]:
    total = sum(joint.link.mass for joint in robot.joint)
    if total > _HEAVIEST_KG or total < 0.05:
        yield Finding("doubtful", "link.mass", f"the moved links weigh {total:.3g} kg", "are the masses in kg?")
    masses = {joint.link.mass for joint in robot.joint}
    if len(masses) == 1 and robot.axes > 2:
        yield Finding("doubtful", "link.mass", f"all links weigh {masses.pop():g} kg", "a placeholder?")


def _efforts(robot: RobotDescription) -> Iterator[Finding]:
    """Rated efforts against what holds the arm in random postures."""
    q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (_POSTURES, robot.axes))
    holding = np.abs(gravity_torque(robot, q)).max(axis=0)
    for joint, needed in zip(robot.joint, holding, strict=True):
        key = f"{joint.name}.{'force_N' if joint.slides else 'torque_Nm'}"
        unit = "N" if joint.slides else "Nm"
        if needed > joint.effort:
            text = f"{joint.effort:g} {unit}, but the stretched arm needs {needed:.3g} {unit} to stand still"
            yield Finding(
                "wrong", key, text, "check the rated effort, the masses and the gravity direction (-z of the base)"
            )
    if holding.max() < _HOLDS_NOTHING:  # level slides, or axes that stand upright
        return
    margin = float((robot.effort / np.maximum(holding, 1e-9)).min())
    if margin > _LARGE_MARGIN:
        text = f"every joint can hold {margin:.0f} times the stretched arm"
        yield Finding("doubtful", "torque_Nm", text, "placeholders in the URDF, or masses that are too small?")


def _drives(robot: RobotDescription) -> Iterator[Finding]:
    for joint, speed, acceleration in zip(robot.joint, robot.speed, robot.acceleration, strict=True):
        drive = joint.drive
        needed = drive.rotor_inertia_kgm2 * acceleration
        if needed > joint.effort:
            text = f"the rotor alone needs {needed / joint.effort:.1f} times the rated effort at full acceleration"
            yield Finding(
                "doubtful", f"{joint.name}.drive", text, "is the rotor inertia reflected to the joint, as it should be?"
            )
        copper = drive.resistance_Ohm * (joint.effort / drive.effort_per_ampere) ** 2
        if copper > 3 * joint.effort * speed:
            times = copper / (joint.effort * speed)
            text = f"copper loss of {copper:.3g} W at rated effort, {times:.1f} times the rated power"
            yield Finding("doubtful", f"{joint.name}.drive", text, "check gear ratio, torque constant and resistance")
        if joint.speed > (_FASTEST_M_S if joint.slides else _FASTEST_DEG_S):
            key = f"{joint.name}.{'speed_m_s' if joint.slides else 'speed_deg_s'}"
            yield Finding("doubtful", key, f"{joint.speed:g}", "a placeholder, or rad taken for deg?")


def _distance(point: Floats, end: Floats) -> float:
    """Distance [m] of `point` from the segment between the origin and `end`."""
    share = float(np.clip(point @ end / max(float(end @ end), 1e-12), 0.0, 1.0))
    return float(np.linalg.norm(point - share * end))


def _listed(moments: Floats) -> str:
    return ", ".join(f"{value:.3g}" for value in moments)
