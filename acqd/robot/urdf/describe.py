"""A robot description from a URDF: kinematics and bodies as in the file, the rest guessed and marked as guessed."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from pydantic import ValidationError

from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import gravity_torque
from acqd.robot.section import complaint
from acqd.robot.urdf.bodies import Bodies, Body, merge_bodies, rounded, triple
from acqd.robot.urdf.branch import Branch, choose_branch, listed
from acqd.robot.urdf.defaults import (
    GRAVITY_MARGIN,
    PLAUSIBLE_FRICTION,
    SPEED,
    Rated,
    guessed_drive,
    guessed_friction,
    key,
)
from acqd.robot.urdf.document import read_urdf
from acqd.robot.urdf.tree import UrdfJoint

_POSTURES = 300
_PLACEHOLDER = 1.0  # Nm or N, until gravity is known
_TURNING_SHARE = 0.1  # of the greatest torque that holds the arm: the least that any of its joints counts as having
_RAIL_SHARE = 0.3  # of the moved weight


@dataclass(frozen=True, slots=True)
class Converted:
    """A description and what the user has to know of it."""

    table: dict[str, Any]
    """The description as TOML holds it."""
    robot: RobotDescription
    notes: list[str]


def describe_urdf(path: Path, name: str | None = None, base: str | None = None, tip: str | None = None) -> Converted:
    """The arm of a URDF between the links `base` and `tip`. Raises InputError where the file leaves a choice."""
    urdf = read_urdf(path)
    branch = choose_branch(urdf, base, tip)
    merged = merge_bodies(urdf, branch)
    bodies = merged.bodies
    notes = [*branch.notes, *_notes(branch, merged)]
    joints = [_joint(joint, body) for joint, body in zip(branch.joints, bodies[1:], strict=True)]
    table: dict[str, Any] = {
        "name": _identifier(name or urdf.name),
        "title": urdf.name,
        "sources": [
            f"kinematics, bodies, limits: {path.name}",
            "what each joint lists as guessed: shares of its rating",
        ],
        "base": {"mass": rounded(bodies[0].inertia.mass), "capsules": _capsules(bodies[0])},
        "joint": joints,
        "flange": _pose(merged.flange),
    }
    _guess_missing_efforts(path, table)
    for joint, source in zip(joints, branch.joints, strict=True):
        notes += _add_drive(joint, source)
    return Converted(table, _validated(path, table), notes + _guesses(joints))


def _notes(branch: Branch, merged: Bodies) -> list[str]:
    notes = []
    if merged.locked:
        notes.append(f"held still at zero, their links added to the arm: {listed(merged.locked)}")
    unlimited = [joint.name for joint in branch.joints if joint.kind == "continuous"]
    if unlimited:
        notes.append(f"continuous, described with limits of one turn either way: {listed(unlimited)}")
    turned = [joint.name for joint in branch.joints if joint.kind == "revolute" and _many_turns(joint)]
    if turned:
        notes.append(f"limits of more than ten turns: {listed(turned)}; are these degrees? A URDF holds rad")
    meshes = sorted({link for body in merged.bodies for link in body.meshes})
    if meshes:
        notes.append(f"no capsules for collision meshes of {listed(meshes)}; acqd lab needs capsules")
    return notes


def _many_turns(joint: UrdfJoint) -> bool:
    return max(abs(joint.lower or 0.0), abs(joint.upper or 0.0)) > 20 * math.pi


def _guesses(joints: list[dict[str, Any]]) -> list[str]:
    """What is guessed, one line per set of keys."""
    sets: dict[str, list[str]] = {}
    for joint in joints:
        sets.setdefault(", ".join(joint["guessed"]), []).append(joint["name"])
    return [f"guessed: {keys} of {', '.join(names)}" for keys, names in sets.items()]


def _joint(joint: UrdfJoint, body: Body) -> dict[str, Any]:
    """The table of a joint without its drive."""
    kind = "prismatic" if joint.kind == "prismatic" else "revolute"
    guessed: list[str] = []
    table: dict[str, Any] = {"name": joint.name, "kind": kind} | _pose(body.placement)
    if kind == "revolute":
        del table["kind"]
    table["axis"] = triple(np.array(joint.axis) / np.linalg.norm(joint.axis))
    per_turn = 1.0 if kind == "prismatic" else 180.0 / math.pi
    if joint.kind == "continuous":
        limits = [-360.0, 360.0]
    elif joint.lower is None or joint.upper is None or not joint.lower < joint.upper:
        limits = [-180.0, 180.0] if kind == "revolute" else [-0.5, 0.5]
        guessed.append(key("limits", kind))
    else:
        limits = [rounded(joint.lower * per_turn), rounded(joint.upper * per_turn)]
    table[key("limits", kind)] = limits
    speed = rounded(joint.velocity * per_turn) if joint.velocity else SPEED[kind]
    if not joint.velocity:
        guessed.append(key("speed", kind))
    table[key("speed", kind)] = speed
    table[key("acceleration", kind)] = 0.0
    table[key("effort", kind)] = rounded(joint.effort) if joint.effort else _PLACEHOLDER
    if not joint.effort:
        guessed.append(key("effort", kind))
    inertia = body.inertia.inertia
    order = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    table["link"] = {
        "mass": rounded(body.inertia.mass),
        "com": triple(body.inertia.lever),
        "inertia": [rounded(float(inertia[k])) for k in order],
    }
    table["capsules"] = _capsules(body)
    table["guessed"] = [*guessed, key("acceleration", kind), "drive"]
    return table


def _guess_missing_efforts(path: Path, table: dict[str, Any]) -> None:
    """Efforts that the URDF does not give: a multiple of what gravity asks for in random postures."""
    kinds = [joint.get("kind", "revolute") for joint in table["joint"]]
    missing = [k for k, joint in enumerate(table["joint"]) if key("effort", kinds[k]) in joint["guessed"]]
    if not missing:
        return
    provisional = [dict(joint) for joint in table["joint"]]
    for joint, kind in zip(provisional, kinds, strict=True):
        joint |= {key("acceleration", kind): 1.0, "drive": guessed_drive(Rated(1.0, 1.0), kind)}
    robot = _validated(path, table | {"joint": provisional})
    q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (_POSTURES, robot.axes))
    holding = np.abs(gravity_torque(robot, q)).max(axis=0)
    turning = max((float(holding[k]) for k in range(robot.axes) if not robot.joint[k].slides), default=0.0)
    for k in missing:  # a vertical axis and a horizontal rail hold nothing, yet they have motors
        moved_kg = sum(joint.link.mass for joint in robot.joint[k:])
        least = _RAIL_SHARE * 9.81 * moved_kg if robot.joint[k].slides else _TURNING_SHARE * turning
        effort = GRAVITY_MARGIN * max(float(holding[k]), least, _PLACEHOLDER)
        table["joint"][k][key("effort", kinds[k])] = float(f"{effort:.2g}")


def _add_drive(table: dict[str, Any], source: UrdfJoint) -> list[str]:
    """Acceleration, drive and friction of a joint whose rating is known. Returns what the user has to know."""
    kind = table.get("kind", "revolute")
    speed = table[key("speed", kind)]
    rated = Rated(table[key("effort", kind)], speed if kind == "prismatic" else math.radians(speed))
    per_turn = 1.0 if kind == "prismatic" else 180.0 / math.pi
    table[key("acceleration", kind)] = float(f"{rated.acceleration * per_turn:.3g}")
    table["drive"] = guessed_drive(rated, kind)
    table["friction"] = guessed_friction(rated, kind)
    share = (source.friction + source.damping * rated.speed) / rated.effort
    if PLAUSIBLE_FRICTION[0] <= share <= PLAUSIBLE_FRICTION[1]:
        table["friction"] = {
            key("coulomb", kind): rounded(source.friction),
            key("viscous", kind): rounded(source.damping),
        }
        return []
    table["guessed"].append("friction")
    if share == 0.0:
        return []
    setting = f"{source.name}: friction in the file is {share:.2g} of the rated effort"
    return [f"{setting}, which is a simulator's setting; guessed instead"]


def _capsules(body: Body) -> list[dict[str, Any]]:
    return [{"radius": each.radius, "from": list(each.start), "to": list(each.end)} for each in body.capsules]


def _pose(placement: Any) -> dict[str, Any]:
    rpy = np.degrees(pin.rpy.matrixToRpy(placement.rotation))
    turned = [rounded(float(angle)) for angle in np.round(rpy, 9)]
    return {"xyz": triple(placement.translation)} | ({"rpy_deg": turned} if any(turned) else {})


def _identifier(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "robot"


def _validated(path: Path, table: dict[str, Any]) -> RobotDescription:
    try:
        return RobotDescription.model_validate(table)
    except ValidationError as error:
        raise InputError(path, "; ".join(complaint(fault) for fault in error.errors())) from None
