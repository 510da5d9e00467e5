"""Inertial parameters of a description in plain numpy, where no robot library is installed."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import Link, RobotDescription
from acqd.robot.newton_euler import Chain, joint_torque, rotation_of


def inertial_parameters(robot: RobotDescription) -> Floats:
    """[10 axes]: m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joint's origin, per link.

    The order is that of `dynamics.regressor`.
    """
    return np.concatenate([_of_link(joint.link) for joint in robot.joint])


def inverse_dynamics(robot: RobotDescription, q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """Joint torques [T, axes] Nm (N of prismatic joints) of the bare robot; gravity is -z of the base."""
    return joint_torque(Chain.of(robot), inertial_parameters(robot), q, qd, qdd)


def gravity_torque(robot: RobotDescription, q: Floats) -> Floats:
    """Joint torques [T, axes] Nm (N of prismatic joints) that hold the bare robot at rest."""
    rest = np.zeros_like(q)
    return inverse_dynamics(robot, q, rest, rest)


def central_tensor(link: Link) -> Floats:
    """Inertia tensor [3, 3] (kg m^2) about the centre of mass, in the axes of the joint's frame."""
    xx, yy, zz, xy, xz, yz = link.inertia
    turn = rotation_of(link.inertia_rpy_deg)
    return np.asarray(turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T)


def _of_link(link: Link) -> Floats:
    c = np.array(link.com, dtype=np.float64)
    I = central_tensor(link) + link.mass * (c @ c * np.eye(3) - np.outer(c, c))  # noqa: E741 parallel axis theorem
    return np.array([link.mass, *(link.mass * c), I[0, 0], I[0, 1], I[1, 1], I[0, 2], I[1, 2], I[2, 2]])
