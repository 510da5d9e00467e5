"""Whether torques or currents of logs are those of another shipped robot with as many axes.

Arms of a family have the same joints in another size, so that their angles do not tell them apart. Their torques do:
the large arm needs several times the torque of the small one, and the weights of its links are distributed otherwise.
A payload or wrong gains make torques larger, too; hence both signs are asked for, and the given robot may carry any
payload.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.order_fit import (
    CLEARLY,
    FEWEST_BLOCKS,
    GAIN_BY_POWER,
    GUESSED_SCALE,
    SIGN_SPEED,
    Fit,
    OrderSample,
)
from acqd.robot.description import RobotDescription, load_description, shipped_descriptions
from acqd.robot.newton_euler import joint_torques

_OTHER_SIZE = 1.5
"""Logged over described torque. Real UR10e arms with up to 3 kg: 0.87 to 1.17, described as a UR5e: 1.8 to 2.4."""
_HEAVIEST = 0.5
"""Share of the arm's mass that no payload has: rated payloads of shipped arms are at most about half."""


def other_robot(robot: RobotDescription, samples: Sequence[OrderSample]) -> str:
    """A line on another shipped robot that explains torques or currents clearly better; empty without one."""
    fit = Fit(robot, samples, GUESSED_SCALE)
    if fit.blocks < FEWEST_BLOCKS:
        return ""
    fit = _with_payload(fit)
    if _same_size(_slope(fit)):
        return ""
    logged = tuple(range(robot.axes))
    gains: dict[str, float] = {}
    for name in shipped_descriptions():
        other = load_description(name)
        if other.axes != robot.axes or name == robot.name:
            continue
        its = Fit(other, samples, GUESSED_SCALE)
        gain, errors = fit.gain_of(its, logged)
        if gain > GAIN_BY_POWER and errors > CLEARLY and _same_size(_slope(its)):
            gains[name] = gain
    if not gains:
        return ""
    best = max(gains, key=lambda name: gains[name])
    return (
        f"torques and angles fit {best} better than {robot.name}, and not only because of a payload: are these logs of "
        f"{robot.name}?"
    )


def _same_size(slope: float) -> bool:
    return 1 / _OTHER_SIZE < slope < _OTHER_SIZE


def _with_payload(fit: Fit) -> Fit:
    """The arm with the mass and first moment at its last link that fit best, if they are a payload's.

    Torques are linear in both: one scale of all torques, and each axis' friction, rotor and offset are fitted too.
    """
    body = slice(len(fit.parameters) - 10, len(fit.parameters) - 6)
    units = np.zeros((5, len(fit.parameters)))
    units[0] = fit.parameters
    units[1:, body] = np.eye(4)
    torques = joint_torques(fit.chain, units, fit.q, fit.qd, fit.qdd)
    X, y = [], []
    for axis in range(fit.q.shape[1]):
        others, seen = _friction_columns(fit, axis), fit.seen[:, axis]
        weight = 1 / (float(seen.std()) + 1e-12)
        of_axis = torques[:, :, axis].T
        X.append(weight * (of_axis - others @ (others.T @ of_axis)))
        y.append(weight * (seen - others @ (others.T @ seen)))
    scale, *moments = np.linalg.lstsq(np.concatenate(X), np.concatenate(y), rcond=None)[0]
    heaviest = _HEAVIEST * float(fit.parameters[::10].sum())
    if not (scale > 0 and 0 < moments[0] / scale < heaviest):
        return fit
    parameters = fit.parameters.copy()
    parameters[body] += np.array(moments) / scale
    return fit.with_parameters(parameters)


def _slope(fit: Fit) -> float:
    """Logged over computed torque of all axes together, without friction, rotor and an offset of each."""
    tau = fit.torques(fit.q, fit.qd, fit.qdd)
    product = square = 0.0
    for axis in range(tau.shape[1]):
        others = _friction_columns(fit, axis)
        of_axis = tau[:, axis] - others @ (others.T @ tau[:, axis])
        product += float(of_axis @ fit.seen[:, axis])
        square += float(of_axis @ of_axis)
    return product / max(square, 1e-12)


def _friction_columns(fit: Fit, axis: int) -> Floats:
    """[T, 4] orthonormal columns of friction, rotor and offset of an axis."""
    qd, qdd = fit.qd[:, axis], fit.qdd[:, axis]
    columns, _ = np.linalg.qr(np.column_stack([np.tanh(qd / SIGN_SPEED), qd, qdd, np.ones(len(qd))]))
    return np.asarray(columns)
