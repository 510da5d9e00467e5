"""Rigid-body dynamics in the base frame by virtual work (d'Alembert's principle), vectorised over rows.

Every body has an inertial force m (a - g) at its centre of mass and an inertial moment I alpha + omega x I omega. The
torque of a joint is the moment of all of them beyond the joint, about the joint's axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tools.studies.foreign.generator.arm import Arm, Body, Floats

GRAVITY = np.array([0.0, 0.0, -9.81])
"""m/s^2."""
_CHUNK = 16_384
"""Rows at a time: the arrays of more rows leave the processor's cache."""


@dataclass(frozen=True, slots=True)
class Posture:
    """Links in the base frame at T rows."""

    origin: list[Floats]
    """Per link [T, 3] m."""
    turn: list[Floats]
    """Per link [T, 3, 3]."""
    axis: list[Floats]
    """Per link [T, 3]."""


def posture(arm: Arm, q: Floats) -> Posture:
    """Forward kinematics of angles [T, n] rad."""
    where = Posture([], [], [])
    origin, turn = np.zeros((len(q), 3)), np.broadcast_to(np.eye(3), (len(q), 3, 3))
    for k in range(arm.joints):
        origin = origin + turn @ arm.offset[k]
        turn = turn @ (arm.turn[k] @ _about(arm.axis[k], q[:, k]))
        where.origin.append(origin)
        where.turn.append(turn)
        where.axis.append(turn @ arm.axis[k])
    return where


def joint_torques(arm: Arm, bodies: Sequence[Body], q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """[T, n] Nm that move the bodies as q, qd, qdd [T, n] (rad, rad/s, rad/s^2) say, against gravity."""
    parts = [slice(first, first + _CHUNK) for first in range(0, len(q), _CHUNK)]
    return np.concatenate([_torques(arm, bodies, q[part], qd[part], qdd[part]) for part in parts])


def force_torques(arm: Arm, q: Floats, point: Floats, force: Floats) -> Floats:
    """[T, n] Nm with which the joints hold against a force [T, 3] N (base frame) on a point of the last link."""
    where = posture(arm, q)
    place = where.origin[-1] + where.turn[-1] @ point
    moments = [np.cross(place - origin, -force) for origin in where.origin]
    return np.stack([(axis * moment).sum(axis=1) for axis, moment in zip(where.axis, moments, strict=True)], axis=1)


def energy(arm: Arm, bodies: Sequence[Body], q: Floats, qd: Floats) -> Floats:
    """[T] J, kinetic and potential."""
    where = posture(arm, q)
    total = np.zeros(len(q))
    for body in bodies:
        omega, velocity = np.zeros((len(q), 3)), np.zeros((len(q), 3))
        place = where.origin[body.link] + where.turn[body.link] @ body.centre
        for k in range(body.link + 1):
            rate = where.axis[k] * qd[:, k : k + 1]
            omega, velocity = omega + rate, velocity + np.cross(rate, place - where.origin[k])
        turned = np.einsum("tji,tj->ti", where.turn[body.link], omega)
        total += 0.5 * body.mass * (velocity**2).sum(axis=1) + 0.5 * (turned * (turned @ body.tensor)).sum(axis=1)
        total -= body.mass * place @ GRAVITY
    return total


def _torques(arm: Arm, bodies: Sequence[Body], q: Floats, qd: Floats, qdd: Floats) -> Floats:
    where = posture(arm, q)
    loads = _inertial_loads(arm, where, bodies, qd, qdd)
    force, moment = np.zeros((len(q), 3)), np.zeros((len(q), 3))
    tau = np.empty_like(q)
    for k in range(arm.joints - 1, -1, -1):
        for own_force, own_moment in loads[k]:
            force, moment = force + own_force, moment + own_moment
        tau[:, k] = (where.axis[k] * (moment - _cross(where.origin[k], force))).sum(axis=1)
    return tau


def _inertial_loads(
    arm: Arm, where: Posture, bodies: Sequence[Body], qd: Floats, qdd: Floats
) -> list[list[tuple[Floats, Floats]]]:
    """Per link the force [T, 3] N of each body and its moment [T, 3] Nm about the base's origin."""
    rows = len(qd)
    omega, alpha, acceleration = np.zeros((rows, 3)), np.zeros((rows, 3)), np.broadcast_to(-GRAVITY, (rows, 3))
    before = np.zeros((rows, 3))
    loads: list[list[tuple[Floats, Floats]]] = []
    for k in range(arm.joints):
        acceleration = acceleration + _point_acceleration(omega, alpha, where.origin[k] - before)
        before = where.origin[k]
        rate = where.axis[k] * qd[:, k : k + 1]
        alpha = alpha + where.axis[k] * qdd[:, k : k + 1] + _cross(omega, rate)
        omega = omega + rate
        loads.append([])
        for body in bodies:
            if body.link == k:
                lever = where.turn[k] @ body.centre
                force = body.mass * (acceleration + _point_acceleration(omega, alpha, lever))
                spin = _moment(where.turn[k], body.tensor, omega, alpha)
                loads[k].append((force, spin + _cross(before + lever, force)))
    return loads


def _point_acceleration(omega: Floats, alpha: Floats, lever: Floats) -> Floats:
    return _cross(alpha, lever) + _cross(omega, _cross(omega, lever))


def _moment(turn: Floats, tensor: Floats, omega: Floats, alpha: Floats) -> Floats:
    """I alpha + omega x I omega in the base frame, [T, 3] Nm."""
    w, a = (vector[:, None, :] @ turn for vector in (omega, alpha))
    spin = (a @ tensor)[:, 0] + _cross(w[:, 0], (w @ tensor)[:, 0])
    return np.asarray((turn @ spin[:, :, None])[:, :, 0])


def _cross(a: Floats, b: Floats) -> Floats:
    """Row by row; several times as fast as np.cross."""
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ],
        axis=1,
    )


def _about(axis: Floats, angle: Floats) -> Floats:
    """[T, 3, 3] rotations about a unit axis: exponential of the skew matrix."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    outer = np.outer(axis, axis)
    cosine, sine = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    return np.asarray(cosine * (np.eye(3) - outer) + sine * skew + outer)
