"""MuJoCo models made from acqd's robot descriptions: an oracle that shares no code with Pinocchio or coal."""

from __future__ import annotations

import mujoco
import numpy as np

from acqd.robot.arm import Payload
from acqd.robot.description import RobotDescription
from acqd.robot.scene import Scene


def _numbers(values) -> str:
    return " ".join(f"{float(value)!r}" for value in values)


def _quaternion(rpy_deg) -> str:
    roll, pitch, yaw = np.radians(rpy_deg)

    def about(axis, angle):
        return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.eye(3)[axis])])

    out, scratch = np.empty(4), np.empty(4)
    mujoco.mju_mulQuat(scratch, about(2, yaw), about(1, pitch))
    mujoco.mju_mulQuat(out, scratch, about(0, roll))
    return _numbers(out)


def _inertial(mass, com, inertia, rpy_deg=(0, 0, 0)) -> str:
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array([float(x) for x in _quaternion(rpy_deg).split()]))
    turn = rotation.reshape(3, 3)
    xx, yy, zz, xy, xz, yz = inertia
    full = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    six = (full[0, 0], full[1, 1], full[2, 2], full[0, 1], full[0, 2], full[1, 2])
    return f'<inertial pos="{_numbers(com)}" mass="{mass!r}" fullinertia="{_numbers(six)}"/>'


def _capsules(link: int, capsules) -> str:
    return "".join(
        f'<geom name="{link}:{k}" type="capsule" size="{c.radius!r}" fromto="{_numbers(c.start)} {_numbers(c.end)}"/>'
        for k, c in enumerate(capsules)
    )


def build(description: RobotDescription, payload: Payload | None = None, scene: Scene | None = None):
    """mujoco.MjModel; geoms are named `link:number`, boxes of the scene by their name."""
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
        body += f'<joint name="{joint.name}" type="hinge" axis="{_numbers(joint.axis)}"/>'
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


def inverse_dynamics(model, q, qd, qdd):
    """[T, axes], Nm."""
    data = mujoco.MjData(model)
    tau = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        # the oracle is asked for smooth dynamics only: contacts of overlapping capsules do not count
        tau[k] = data.qfrc_inverse + data.qfrc_constraint
    return tau


def flange(model, q):
    """Flange positions [T, 3] and rotations [T, 3, 3]."""
    data = mujoco.MjData(model)
    positions, rotations = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for k, row in enumerate(q):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        site = data.site("flange")
        positions[k], rotations[k] = site.xpos, site.xmat.reshape(3, 3)
    return positions, rotations


def clearance(description: RobotDescription, scene: Scene, path, ignored=()):
    """Smallest distance [m] of arm to itself and to the boxes along `path` [T, axes]; overlap is negative."""
    model = build(description, scene=scene)
    data = mujoco.MjData(model)
    names = [model.geom(k).name for k in range(model.ngeom)]
    apart = {tuple(sorted(pair)) for pair in [*description.ignore_pairs, *ignored]}
    pairs = []
    for one in range(model.ngeom):
        for other in range(one + 1, model.ngeom):
            boxes = [names[k].startswith("box") for k in (one, other)]
            links = [None if box else int(names[k].split(":")[0]) for k, box in zip((one, other), boxes, strict=True)]
            if all(boxes) or any(boxes) and 0 in links:
                continue
            if not any(boxes) and (abs(links[0] - links[1]) < 2 or tuple(sorted(links)) in apart):
                continue
            pairs.append((one, other))
    smallest, fromto = np.inf, np.zeros(6)
    for row in path:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        smallest = min(smallest, *(mujoco.mj_geomDistance(model, data, a, b, 0.05, fromto) for a, b in pairs))
    return smallest
