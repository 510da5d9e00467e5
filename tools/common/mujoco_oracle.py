"""MuJoCo models of acqd's robot descriptions: a test oracle that shares no code with Pinocchio or coal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import mujoco
import numpy as np

from acqd.arrays import Floats
from acqd.robot.arm import Payload
from acqd.robot.description import Capsule, RobotDescription
from acqd.robot.scene import Scene


def _numbers(values: Iterable[float] | Floats) -> str:
    return " ".join(f"{float(value)!r}" for value in values)


def _quaternion(rpy_deg: Sequence[float]) -> str:
    roll, pitch, yaw = np.radians(rpy_deg)

    def about(axis: int, angle: float) -> Floats:
        return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.eye(3)[axis])])

    out, scratch = np.empty(4), np.empty(4)
    mujoco.mju_mulQuat(scratch, about(2, yaw), about(1, pitch))
    mujoco.mju_mulQuat(out, scratch, about(0, roll))
    return _numbers(out)


def _inertial(mass: float, com: Sequence[float], inertia: Sequence[float], rpy_deg: Sequence[float] = (0, 0, 0)) -> str:
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array([float(x) for x in _quaternion(rpy_deg).split()]))
    R = rotation.reshape(3, 3)
    xx, yy, zz, xy, xz, yz = inertia
    tensor = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    elements = (tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2])
    return f'<inertial pos="{_numbers(com)}" mass="{mass!r}" fullinertia="{_numbers(elements)}"/>'


def _capsules(link: int, capsules: Sequence[Capsule]) -> str:
    return "".join(
        f'<geom name="{link}:{k}" type="capsule" size="{c.radius!r}" fromto="{_numbers(c.start)} {_numbers(c.end)}"/>'
        for k, c in enumerate(capsules)
    )


def build(description: RobotDescription, payload: Payload | None = None, scene: Scene | None = None) -> Any:
    """A mujoco.MjModel. Its geoms are named `LINK:NUMBER` and, for boxes of the scene, `box NAME`."""
    head = '<mujoco><compiler angle="radian" balanceinertia="false" boundmass="0" inertiafromgeom="false"/>'
    head += '<option gravity="0 0 -9.81"/><worldbody>'
    boxes = "".join(
        f'<geom name="box {box.name}" type="box" pos="{_numbers(box.centre)}" quat="{_quaternion(box.rpy_deg)}" '
        f'size="{_numbers(np.array(box.size) / 2)}"/>'
        for box in (scene.box if scene else [])
    )
    body = head + boxes + _capsules(0, description.base.capsules)
    for number, joint in enumerate(description.joint, start=1):
        body += f'<body pos="{_numbers(joint.xyz)}" quat="{_quaternion(joint.rpy_deg)}">'
        body += (
            f'<joint name="{joint.name}" type="{"slide" if joint.slides else "hinge"}" axis="{_numbers(joint.axis)}"/>'
        )
        link = joint.link
        body += _inertial(link.mass, link.com, link.inertia, link.inertia_rpy_deg) + _capsules(number, joint.capsules)
    flange = description.flange
    body += f'<body pos="{_numbers(flange.xyz)}" quat="{_quaternion(flange.rpy_deg)}"><site name="flange"/>'
    if payload is not None:
        body += _inertial(payload.mass, payload.com, payload.inertia)
    if scene is not None and scene.tool is not None:
        body += _capsules(description.axes + 1, scene.tool.capsules)
    body += "</body>" * (description.axes + 1) + "</worldbody></mujoco>"
    return mujoco.MjModel.from_xml_string(body)


def inverse_dynamics(model: Any, q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """Joint torques [T, axes] (Nm) for motions [T, axes] (rad, rad/s, rad/s^2)."""
    data = mujoco.MjData(model)
    tau = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        # without the constraint forces: capsules that overlap are in contact in MuJoCo
        tau[k] = data.qfrc_inverse + data.qfrc_constraint
    return tau


def flange(model: Any, q: Floats) -> tuple[Floats, Floats]:
    """Flange positions [T, 3] (m) and rotations [T, 3, 3] for joint angles [T, axes] (rad)."""
    data = mujoco.MjData(model)
    positions, rotations = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for k, row in enumerate(q):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        site = data.site("flange")
        positions[k], rotations[k] = site.xpos, site.xmat.reshape(3, 3)
    return positions, rotations


def clearance(description: RobotDescription, scene: Scene, path: Floats) -> float:
    """Smallest distance (m) of the arm to itself and to the boxes along `path` [T, axes]; negative for an overlap."""
    model = build(description, scene=scene)
    data = mujoco.MjData(model)
    pairs = _pairs(description, [model.geom(k).name for k in range(model.ngeom)])
    smallest, fromto = np.inf, np.zeros(6)
    for row in path:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        smallest = min(smallest, *(mujoco.mj_geomDistance(model, data, a, b, 0.05, fromto) for a, b in pairs))
    return float(smallest)


def _pairs(description: RobotDescription, names: list[str]) -> list[tuple[int, int]]:
    """Geoms that must not touch: links that are not neighbours, and moving links with boxes."""
    ignored = {(min(pair), max(pair)) for pair in description.ignore_pairs}
    links = [None if name.startswith("box") else int(name.split(":")[0]) for name in names]

    def must_not_touch(a: int | None, b: int | None) -> bool:
        if a is None or b is None:
            return not (a is b or 0 in (a, b))
        return abs(a - b) >= 2 and (min(a, b), max(a, b)) not in ignored

    return [(a, b) for a, b in combinations(range(len(links)), 2) if must_not_touch(links[a], links[b])]
