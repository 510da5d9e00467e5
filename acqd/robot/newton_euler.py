"""Inverse dynamics for whole recordings at once, with any inertial parameters: in C, or in numpy without a compiler.

Recursive Newton-Euler algorithm in link frames (Luh, Walker, Paul: On-line computational scheme for mechanical
manipulators, 1980). Models use it at run time, where no robot library is installed; the tests compare it with
`dynamics.py` (Pinocchio).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription
from acqd.robot.rigid_body import Turned, torques

_GRAVITY = 9.81
_TOGETHER = 4096
"""Rows at a time: what one joint needs stays in the processor's cache."""


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
    packed: Floats = field(init=False, repr=False, compare=False)
    """[axes, 28] of every joint what `rigid_body.torques` asks for."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "packed", _packed(self))

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


def joint_torque(
    chain: Chain, parameters: Floats, q: Floats, qd: Floats, qdd: Floats, *, turned: Turned | None = None
) -> Floats:
    """Joint torques [T, axes] (Nm; forces in N of prismatic joints) of a motion [T, axes].

    `parameters` are the inertial parameters [10 axes] in the order of `dynamics.regressor`. `turned`: of these angles,
    for who asks for the torques of one motion again and again.
    """
    return np.asarray(joint_torques(chain, parameters[None], q, qd, qdd, turned=turned)[0])


def joint_torques(
    chain: Chain, arms: Floats, q: Floats, qd: Floats, qdd: Floats, *, turned: Turned | None = None
) -> Floats:
    """As `joint_torque`, of several sets of inertial parameters [n, 10 axes]: [n, T, axes]."""
    links = arms.reshape(len(arms), len(chain.axis), 10)
    compiled = torques(chain.packed, _GRAVITY, links, q, qd, qdd, turned)
    return torques_in_numpy(chain, links, q, qd, qdd) if compiled is None else compiled


def regressor(chain: Chain, q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """Y [T, axes, 10 axes] with joint_torque = Y @ inertial parameters."""
    bodies = joint_torques(chain, np.eye(10 * len(chain.axis)), q, qd, qdd)
    return np.ascontiguousarray(np.moveaxis(bodies, 0, -1))


def torques_in_numpy(chain: Chain, links: Floats, q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """The same with numpy, of bodies `links` [n, axes, 10]."""
    tau = np.empty((len(links), *q.shape))
    for first in range(0, len(q), _TOGETHER):
        rows = slice(first, first + _TOGETHER)
        moving = _moving(chain, *(np.ascontiguousarray(each[rows].T) for each in (q, qd, qdd)))
        for number, own in enumerate(links):
            tau[number, rows] = _carried(chain, own, moving).T
    return tau


def _packed(chain: Chain) -> Floats:
    packed = np.empty((len(chain.axis), 28))
    for k, own in enumerate(packed):
        joint = _Joint.of(chain, k, np.zeros(1))
        slide = chain.rotation[k] @ chain.axis[k] if joint.slides else np.zeros(3)
        basis = np.eye(3) if joint.basis is None else joint.basis
        own[:] = np.concatenate(
            [chain.xyz[k], slide, joint.fixed.ravel(), basis.ravel(), chain.axis[k], [float(joint.slides)]]
        )
    return packed


def _moving(chain: Chain, q: Floats, qd: Floats, qdd: Floats) -> list[_Moving]:
    """All links at positions, velocities and accelerations [axes, T] of the joints, from the base on."""
    links: list[_Moving] = []
    motion = np.zeros((3, 3, q.shape[1]))
    motion[2, 2] = _GRAVITY
    field = np.zeros_like(motion)
    for k, axis in enumerate(chain.axis):
        joint = _Joint.of(chain, k, q[k])
        carried = motion.copy()
        carried[:, 2] += _at(joint.place, field)
        motion = joint.to_link(carried)
        w, dw, dv = motion.swapaxes(0, 1)
        turned = qd[k] * (_cross_matrix(axis).T @ w)
        if joint.slides:  # Coriolis and relative acceleration along the axis
            dv += 2.0 * turned + axis[:, None] * qdd[k]
        else:
            dw += turned + axis[:, None] * qdd[k]
            w += axis[:, None] * qd[k]
        field = _acceleration_field(w, dw)
        links.append(_Moving(joint, motion, field))
    return links


def _carried(chain: Chain, bodies: Floats, moving: list[_Moving]) -> Floats:
    """[axes, T] torques that `bodies` [axes, 10] on the moving links need, from the tip on."""
    rows = moving[0].motion.shape[2]
    tau = np.zeros((len(moving), rows))
    load: Floats | None = None  # force and moment [3, which, T]
    for k in range(len(moving) - 1, -1, -1):
        if load is not None:
            after = moving[k + 1].joint
            load = after.to_parent(load)
            load[:, 1] += _moment(after.place, load[:, 0])
        if bodies[k].any():
            load = np.zeros((3, 2, rows)) if load is None else load
            mass, first, tensor = bodies[k, 0], bodies[k, 1:4], _tensor(bodies[k, 4:])
            w, dw, dv = moving[k].motion.swapaxes(0, 1)
            load[:, 0] += mass * dv + _at(first, moving[k].field)
            load[:, 1] += tensor @ dw + _cross(w, tensor @ w) + _moment(first, dv)
        if load is not None:
            tau[k] = chain.axis[k] @ load[:, 0 if moving[k].joint.slides else 1]
    return tau


@dataclass(frozen=True, slots=True)
class _Joint:
    """A joint at T positions: its frame in the frame of the joint before it."""

    place: Floats
    """Origin [3] or [3, T] m."""
    fixed: Floats
    """[3, 3] from the frame in which the joint turns about z to the parent's frame."""
    basis: Floats | None
    """[3, 3] from that frame to the link's frame; None: they are the same."""
    cosine: Floats
    sine: Floats
    """[T], or [1] of a prismatic joint."""
    slides: bool

    @classmethod
    def of(cls, chain: Chain, k: int, q: Floats) -> _Joint:
        """Joint `k` at positions `q` [T]."""
        rotation, axis, place = chain.rotation[k], chain.axis[k], chain.xyz[k]
        if k in chain.sliding:
            place = place[:, None] + (rotation @ axis)[:, None] * q
            return cls(place, rotation, None, np.ones(1), np.zeros(1), slides=True)
        basis = None if axis[2] == 1.0 else _with_z(tuple(axis.tolist()))
        fixed = rotation if basis is None else rotation @ basis
        return cls(place, fixed, basis, np.cos(q), np.sin(q), slides=False)

    def to_link(self, v: Floats) -> Floats:
        """Vectors [3, n, T] from the parent's frame to the link's frame."""
        turned = _about_z(_times(self.fixed.T, v), self.cosine, -self.sine)
        return turned if self.basis is None else _times(self.basis, turned)

    def to_parent(self, v: Floats) -> Floats:
        """Vectors [3, n, T] from the link's frame to the parent's frame."""
        turned = v if self.basis is None else _times(self.basis.T, v)
        return _times(self.fixed, _about_z(turned, self.cosine, self.sine))


@dataclass(frozen=True, slots=True)
class _Moving:
    """A link at T moments, in its frame; vectors are [3, T], so that every operation runs along the rows."""

    joint: _Joint
    motion: Floats
    """[3, 3, T]: components of the angular velocity, the angular and the linear acceleration."""
    field: Floats
    """As `_acceleration_field`."""


@dataclass(frozen=True, slots=True)
class Frames:
    """Poses of all links in the base frame."""

    origin: Floats
    """Origins [T, axes, 3] m."""
    rotation: Floats
    """Rotations to the base frame [T, axes, 3, 3]."""
    axis: Floats
    """Joint axes [T, axes, 3], unit vectors."""


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
    return Frames(origin, rotation, np.einsum("tkij,kj->tki", rotation, chain.axis))


def _cross_matrix(v: Floats) -> Floats:
    """Matrix M [3, 3] of a vector [3] with M @ a = v x a."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _cross(a: Floats, b: Floats) -> Floats:
    """a x b of vectors [3, T]."""
    x, y, z = a
    u, v, w = b
    return np.stack((y * w - z * v, z * u - x * w, x * v - y * u))


def _moment(place: Floats, force: Floats) -> Floats:
    """place x force; `place` [3] or [3, T], `force` [3, T]."""
    return np.asarray(_cross_matrix(place) @ force) if place.ndim == 1 else _cross(place, force)


def _acceleration_field(w: Floats, dw: Floats) -> Floats:
    """B [3 of the place, 3, T] with dw x p + w x (w x p) = sum of p[j] B[j]: what turning adds at a place p."""
    x, y, z = w
    u, v, t = dw
    field = np.empty((3, *w.shape))
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    np.negative(yy + zz, out=field[0, 0])
    np.negative(xx + zz, out=field[1, 1])
    np.negative(xx + yy, out=field[2, 2])
    np.add(xy, t, out=field[0, 1])
    np.subtract(xy, t, out=field[1, 0])
    np.subtract(xz, v, out=field[0, 2])
    np.add(xz, v, out=field[2, 0])
    np.add(yz, u, out=field[1, 2])
    np.subtract(yz, u, out=field[2, 1])
    return field


def _at(place: Floats, field: Floats) -> Floats:
    """[3, T] the field at a place [3] or [3, T]."""
    if place.ndim == 1:
        return np.asarray(place @ field.reshape(3, -1)).reshape(field.shape[1:])
    return np.asarray((place[:, None] * field).sum(axis=0))


def _times(matrix: Floats, v: Floats) -> Floats:
    """Vectors [3, n, T] times a matrix [3, 3]."""
    return np.asarray(matrix @ v.reshape(3, -1)).reshape(v.shape)


def _about_z(v: Floats, cosine: Floats, sine: Floats) -> Floats:
    """Vectors [3, n, T] turned about z."""
    turned = np.empty_like(v)
    x, y = v[0], v[1]
    np.multiply(cosine, x, out=turned[0])
    turned[0] -= sine * y
    np.multiply(sine, x, out=turned[1])
    turned[1] += cosine * y
    turned[2] = v[2]
    return turned


@lru_cache(maxsize=256)  # an arm has few axes, and asks for their rotations in every call
def _with_z(axis: tuple[float, float, float]) -> Floats:
    """A rotation [3, 3] that turns z into a unit vector, read-only."""
    z = np.array(axis)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    basis = np.column_stack((x, np.cross(z, x), z))
    basis.flags.writeable = False
    return basis


def _tensor(six: Floats) -> Floats:
    """Symmetric matrix [3, 3] of xx, xy, yy, xz, yz, zz."""
    xx, xy, yy, xz, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _axis_rotation(axis: Floats, angle: Floats) -> Floats:
    """Rotations [T, 3, 3] by `angle` [T] about a unit axis (Rodrigues' formula)."""
    K = _cross_matrix(axis)
    sine, rest = np.sin(angle)[:, None, None], (1 - np.cos(angle))[:, None, None]
    return np.asarray(np.eye(3) + sine * K + rest * (K @ K))


@lru_cache(maxsize=1024)  # of the joints and links of a few robots, whose chains are made again and again
def rotation_of(rpy_deg: tuple[float, float, float]) -> Floats:
    """Rotation [3, 3], read-only: roll about x, then pitch about y, then yaw about z of the fixed frame (URDF)."""
    rpy = np.radians(rpy_deg)
    roll, pitch, yaw = (_axis_rotation(np.eye(3)[k], rpy[k : k + 1])[0] for k in range(3))
    rotation = np.asarray(yaw @ pitch @ roll)
    rotation.flags.writeable = False
    return rotation
