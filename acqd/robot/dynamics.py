"""Torques, energies and the regressor that is linear in the inertial parameters.

Rigid bodies only: no friction, rotors or losses. The arrays hold whole recordings: [T, axes].
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from acqd.arrays import Floats
from acqd.robot.arm import Arm, Payload
from acqd.robot.description import RobotDescription


def inverse_dynamics(arm: Arm, q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """Joint torques [T, axes] (Nm) by the recursive Newton-Euler algorithm; gravity is -z of the base."""
    tau = np.empty_like(q)
    model, data, rnea = arm.model, arm.data, pin.rnea
    for k in range(len(q)):
        tau[k] = rnea(model, data, q[k], qd[k], qdd[k])
    return tau


def gravity_torque(arm: Arm, q: Floats) -> Floats:
    """Joint torques [T, axes] (Nm) that hold the arm at rest."""
    return np.array([pin.computeGeneralizedGravity(arm.model, arm.data, row) for row in q]).reshape(q.shape)


def mechanical_energy(arm: Arm, q: Floats, qd: Floats) -> Floats:
    """Kinetic plus potential energy [T] (J); potential energy is zero in the base plane."""
    model, data = arm.model, arm.data
    return np.array(
        [
            pin.computeKineticEnergy(model, data, q[k], qd[k]) + pin.computePotentialEnergy(model, data, q[k])
            for k in range(len(q))
        ]
    )


def regressor(arm: Arm, q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """Y [T, axes, 10 axes] with tau = Y @ inertial_parameters(arm).

    Ten parameters per link, in its frame: m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz at the frame origin.
    """
    rows = np.empty((len(q), arm.axes, 10 * arm.axes))
    for k in range(len(q)):
        rows[k] = pin.computeJointTorqueRegressor(arm.model, arm.data, q[k], qd[k], qdd[k])
    return rows


def inertial_parameters(arm: Arm) -> Floats:
    """Inertial parameters [10 axes] in the order of `regressor`."""
    return np.concatenate([arm.model.inertias[k].toDynamicParameters() for k in range(1, arm.axes + 1)])


def payload_regressor(description: RobotDescription, q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """Y [T, axes, 10]: joint torques of a body at the flange, per inertial parameter in the flange frame.

    It is the last link's block of the regressor, with the parameters of the body moved from the flange to
    that link. Both maps are linear, so ten unit parameter vectors give the ten columns.
    """
    arm = Arm(description)
    last = regressor(arm, q, qd, qdd)[:, :, -10:]
    placement = arm.model.frames[arm.flange].placement
    return np.asarray(last @ _moved(placement))


def payload_parameters(payload: Payload) -> Floats:
    """Inertial parameters [10] of a payload in the order of `payload_regressor`."""
    xx, yy, zz, xy, xz, yz = payload.inertia
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    parameters: Floats = pin.Inertia(payload.mass, np.array(payload.com), tensor).toDynamicParameters()
    return parameters


def _moved(placement: pin.SE3) -> Floats:
    """Matrix [10, 10] that maps dynamic parameters from the flange frame to the link frame."""
    turn, shift = placement.rotation, placement.translation
    columns = np.zeros((10, 10))
    for k in range(10):
        unit = np.zeros(10)
        unit[k] = 1.0
        mass, first = unit[0], unit[1:4]
        tensor = np.array([[unit[4], unit[5], unit[7]], [unit[5], unit[6], unit[8]], [unit[7], unit[8], unit[9]]])
        turned = turn @ first
        # parallel axis theorem for the first moment and the tensor about a shifted origin
        moved_first = turned + mass * shift
        cross = _skew(shift) @ _skew(turned)
        moved = turn @ tensor @ turn.T - cross - cross.T - mass * _skew(shift) @ _skew(shift)
        columns[:, k] = [
            mass,
            *moved_first,
            moved[0, 0],
            moved[0, 1],
            moved[1, 1],
            moved[0, 2],
            moved[1, 2],
            moved[2, 2],
        ]
    return columns


def _skew(v: Floats) -> Floats:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
