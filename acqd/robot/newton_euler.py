"""Inverse dynamics in plain numpy for whole recordings at once, with any inertial parameters.

Recursive Newton-Euler algorithm in link frames (Luh, Walker, Paul: On-line computational scheme for mechanical
manipulators, 1980). Models use it at run time, where no robot library is installed; the tests compare it with
`dynamics.py` (Pinocchio).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription

_GRAVITY = 9.81


@dataclass(frozen=True, slots=True)
class Chain:
    """Geometry of a serial arm: the frame of each joint in the frame of the joint before it, and its axis."""

    xyz: Floats
    """[axes, 3] m."""
    rotation: Floats
    """[axes, 3, 3]."""
    axis: Floats
    """[axes, 3] unit vectors."""
    tip: Floats
    """[2, 3]: the flange's origin and its z axis, in the last joint's frame."""
    sliding: tuple[int, ...] = ()
    """Numbers of the prismatic joints, from 0."""

    @classmethod
    def of(cls, robot: RobotDescription) -> Chain:
        """The chain of a robot description."""
        axis = np.array([joint.axis for joint in robot.joint], dtype=np.float64)
        return cls(
            np.array([joint.xyz for joint in robot.joint], dtype=np.float64),
            np.array([rotation_of(joint.rpy_deg) for joint in robot.joint]),
            axis / np.linalg.norm(axis, axis=1, keepdims=True),
            np.array([robot.flange.xyz, rotation_of(robot.flange.rpy_deg)[:, 2]], dtype=np.float64),
            robot.sliding,
        )

    def pose(self, k: int, q: Floats) -> tuple[Floats, Floats]:
        """Origin [3] or [T, 3] (m) and rotation [T, 3, 3] of joint `k` at positions [T], in the joint before it."""
        if k in self.sliding:
            return self.xyz[k] + q[:, None] * (self.rotation[k] @ self.axis[k]), np.tile(
                self.rotation[k], (len(q), 1, 1)
            )
        return self.xyz[k], self.rotation[k] @ _axis_rotation(self.axis[k], q)

    def beyond_flange(self, reach_m: float) -> Floats:
        """Point [3] (m, in the last joint's frame) at the distance `reach_m` from the flange along its z axis."""
        return np.asarray(self.tip[0] + reach_m * self.tip[1])


def joint_torque(chain: Chain, parameters: Floats, q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """Joint torques [T, axes] (Nm; forces in N of prismatic joints) of a motion [T, axes].

    `parameters` are the inertial parameters [10 axes] in the order of `dynamics.regressor`.
    """
    links = parameters.reshape(-1, 10)
    rows, axes = q.shape
    # per link: its place in its parent; angular velocity, angular and linear acceleration [T,3] in its frame
    origins: list[Floats] = []
    rotations: list[Floats] = []
    moving: list[tuple[Floats, Floats, Floats]] = []
    w, dw, dv = np.zeros((rows, 3)), np.zeros((rows, 3)), np.tile([0.0, 0.0, _GRAVITY], (rows, 1))
    for k in range(axes):
        p, R = chain.pose(k, q[:, k])
        axis, rate, change = chain.axis[k], qd[:, k : k + 1], qdd[:, k : k + 1]
        dv = _to_link(R, dv + _cross_place(dw, p) + _double_cross(w, p))
        w, dw = _to_link(R, w), _to_link(R, dw)
        if k in chain.sliding:  # Coriolis and relative acceleration along the axis
            dv = dv + 2.0 * rate * (w @ _cross_matrix(axis)) + axis * change
        else:
            dw = dw + rate * (w @ _cross_matrix(axis)) + axis * change
            w = w + axis * rate
        origins.append(p)
        rotations.append(R)
        moving.append((w, dw, dv))
    tau = np.empty_like(q)
    force, moment = np.zeros((rows, 3)), np.zeros((rows, 3))
    for k in range(axes - 1, -1, -1):
        mass, first, tensor = links[k, 0], links[k, 1:4], _tensor(links[k, 4:])
        (w, dw, dv), first_cross = moving[k], _cross_matrix(first)
        if k < axes - 1:
            force = _to_parent(rotations[k + 1], force)
            moment = _to_parent(rotations[k + 1], moment) - _cross_place(force, origins[k + 1])
        force = force + mass * dv + dw @ first_cross + _double_cross(w, first)
        moment = moment + dw @ tensor + _cross(w, w @ tensor) - dv @ first_cross
        tau[:, k] = (force if k in chain.sliding else moment) @ chain.axis[k]
    return tau


@dataclass(frozen=True, slots=True)
class Frames:
    """Poses of all links in the base frame."""

    origin: Floats
    """Origins [T, axes, 3] m."""
    rotation: Floats
    """Rotations to the base frame [T, axes, 3, 3]."""
    axis: Floats
    """Joint axes [T, axes, 3], unit vectors."""
    sliding: tuple[int, ...] = ()
    """Numbers of the prismatic joints, from 0."""


def frames(chain: Chain, q: Floats) -> Frames:
    """Forward kinematics of angles [T, axes]."""
    rows, axes = q.shape
    origin, rotation = np.empty((rows, axes, 3)), np.empty((rows, axes, 3, 3))
    at, turn = np.zeros((rows, 3)), np.tile(np.eye(3), (rows, 1, 1))
    for k in range(axes):
        place, rotated = chain.pose(k, q[:, k])
        at = at + (turn @ place if place.ndim == 1 else np.einsum("tij,tj->ti", turn, place))
        turn = turn @ rotated
        origin[:, k], rotation[:, k] = at, turn
    return Frames(origin, rotation, np.einsum("tkij,kj->tki", rotation, chain.axis), chain.sliding)


def weight_torque(where: Frames, link: int, point: Floats) -> Floats:
    """Torques [T, axes] (Nm, or N) that hold 1 kg against gravity at `point` (m, in the frame of `link`, from 0)."""
    place = where.origin[:, link] + where.rotation[:, link] @ point
    arm = place[:, None, :2] - where.origin[:, : link + 1, :2]
    axis = where.axis[:, : link + 1]
    torque = np.zeros(where.axis.shape[:2])
    torque[:, : link + 1] = _GRAVITY * (axis[..., 0] * arm[..., 1] - axis[..., 1] * arm[..., 0])
    for k in where.sliding:
        if k <= link:
            torque[:, k] = _GRAVITY * axis[:, k, 2]
    return torque


def _cross_matrix(v: Floats) -> Floats:
    """Matrix M with a @ M = a x v."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _cross_place(a: Floats, v: Floats) -> Floats:
    """a x v of vectors [T, 3] with one vector [3], or with [T, 3]."""
    return a @ _cross_matrix(v) if v.ndim == 1 else _cross(a, v)


def _double_cross(w: Floats, v: Floats) -> Floats:
    """w x (w x v) of vectors [T, 3] with one vector [3], or with [T, 3]."""
    along = w @ v if v.ndim == 1 else (w * v).sum(axis=1)
    return np.asarray(w * along[:, None] - v * (w * w).sum(axis=1)[:, None])


def _cross(a: Floats, b: Floats) -> Floats:
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def _to_link(R: Floats, v: Floats) -> Floats:
    """Vectors [T, 3] from the parent's frame to the link's frame."""
    return np.asarray((v[:, None, :] @ R)[:, 0])


def _to_parent(R: Floats, v: Floats) -> Floats:
    """Vectors [T, 3] from the link's frame to the parent's frame."""
    return np.asarray((R @ v[:, :, None])[:, :, 0])


def _tensor(six: Floats) -> Floats:
    """Symmetric matrix [3, 3] of xx, xy, yy, xz, yz, zz."""
    xx, xy, yy, xz, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _axis_rotation(axis: Floats, angle: Floats) -> Floats:
    """Rotations [T, 3, 3] by `angle` [T] about a unit axis (Rodrigues' formula)."""
    K = _cross_matrix(axis)
    sine, rest = np.sin(angle)[:, None, None], (1 - np.cos(angle))[:, None, None]
    return np.asarray(np.eye(3) + sine * K + rest * (K @ K))


def rotation_of(rpy_deg: tuple[float, float, float]) -> Floats:
    """Rotation [3, 3]: roll about x, then pitch about y, then yaw about z of the fixed frame (URDF)."""
    rpy = np.radians(rpy_deg)
    roll, pitch, yaw = (_axis_rotation(np.eye(3)[k], rpy[k : k + 1])[0] for k in range(3))
    return np.asarray(yaw @ pitch @ roll)
