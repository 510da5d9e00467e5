"""Logged joint torques as a function of the motion, in plain numpy: a reference to which later recordings compare.

    y_j = Y_j(q, qd, qdd) pi_j + zero_j + C_j sign(qd_j) + V_j qd_j + J_j qdd_j

is linear in its parameters. Every joint has parameters of its own, so that the gain and the unit of its sensor or
drive are of no account. What the motions do not determine follows from the grey box, whose parameters are the prior
(Bayesian linear regression; identification of inertial parameters: Gautier and Khalil 1990).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import inertial_spread
from acqd.models.segments import Segment
from acqd.residual.known_rows import known_rows
from acqd.residual.logged_torque import Side, has_torque, logged
from acqd.residual.thresholds import NOISE
from acqd.robot.newton_euler import joint_torques

_MEMORY_ROWS = 10.0
"""Neighbouring rows that tell as much as one independent row."""


@dataclass(frozen=True, slots=True)
class JointRows:
    """Columns and torque of one recording, per joint; rows that say nothing about the joint are 0."""

    columns: Floats
    """[axes, T, k + 1]: columns of the parameters, and the torque in Nm or A."""
    known: Floats
    """[T, axes] 0 or 1: the motion is known, the brakes are open and, on the motor side, the joint moves."""

    @classmethod
    def of(cls, model: GreyBox, segment: Segment, side: Side) -> JointRows | None:
        """None for a recording without torques on that side."""
        torque = logged(segment, side)
        if torque is None or not has_torque(segment, side):
            return None
        q, qd, qdd = segment.motion(model.step_s)
        bodies = joint_torques(model.chain, np.eye(10 * model.axes), q, qd, qdd)
        known = np.zeros_like(q)
        known[known_rows(segment)] = 1.0
        if "brake" in segment.signals:  # closed brakes carry the arm
            known *= (segment.signals["brake"] == 1.0)[:, None]
        if side == "motor":  # a joint at rest sticks: its motor carries any torque up to breakaway
            known *= np.abs(qd) > NOISE.stick_rad_s
        columns = np.concatenate([bodies, np.stack([np.ones_like(q), model.direction(qd), qd, qdd, torque])])
        return cls((columns * known).transpose(2, 1, 0), known)

    def products(self) -> Floats:
        """[axes, k + 1, k + 1] sums over the rows."""
        return np.asarray(self.columns.transpose(0, 2, 1) @ self.columns)

    def residual(self, parameters: Floats) -> Floats:
        """[T, axes], logged minus modelled torque with parameters [axes, k]; NaN where nothing is known."""
        modelled = np.einsum("jtk,jk->tj", self.columns[:, :, :-1], parameters)
        return np.where(self.known > 0, self.columns[:, :, -1].T - modelled, np.nan)


def fitted(model: GreyBox, side: Side, products: Floats) -> Floats:
    """[axes, k] parameters from products [axes, k + 1, k + 1] of recordings; a joint that never moved has zeros."""
    inertial = model.group("inertial")
    friction = np.stack([model.group(name) for name in ("coulomb", "viscous", "rotor")])
    friction = friction * (side == "motor")
    return np.stack(
        [
            _fitted(sums, np.concatenate([inertial, [0.0], friction[:, joint]]), inertial_spread(inertial))
            for joint, sums in enumerate(products)
        ]
    )


def _fitted(sums: Floats, torque_Nm: Floats, spread: Floats) -> Floats:
    """[k] parameters of a joint. Those of its torque in Nm, times its gain, are the prior."""
    A, b, square = sums[:-1, :-1], sums[:-1, -1], float(sums[-1, -1])
    rows, modelled = float(A[len(spread), len(spread)]), float(torque_Nm @ A @ torque_Nm)
    if rows == 0.0 or modelled == 0.0:
        return np.zeros(len(b))
    mean = torque_Nm * float(torque_Nm @ b) / modelled
    size = np.sqrt(square / rows)
    others = size / np.sqrt(np.diag(A)[len(spread) :] / rows + 1e-12)  # as large as the torque, at most
    deviation = np.concatenate([spread * np.sqrt(square / modelled), others])
    parameters: Floats = mean
    variance = 0.01 * square / rows
    for _ in range(2):
        precision, scale = np.diag(deviation**-2.0), _MEMORY_ROWS * variance
        parameters = np.asarray(np.linalg.solve(A / scale + precision, b / scale + precision @ mean))
        variance = max(float(square - 2 * parameters @ b + parameters @ A @ parameters), 1e-9 * square) / rows
    return parameters


def unseen_residuals(model: GreyBox, side: Side, recordings: Sequence[JointRows], folds: int) -> list[Floats]:
    """[T, axes] per recording, of parameters from the others: contiguous `folds`, so that a slow drift is an error."""
    products = [each.products() for each in recordings]
    whole = np.sum(products, axis=0)
    residuals: list[Floats] = []
    for numbers in np.array_split(np.arange(len(recordings)), min(folds, len(recordings))):
        parameters = fitted(model, side, whole - np.sum([products[k] for k in numbers], axis=0))
        residuals += [recordings[k].residual(parameters) for k in numbers]
    return residuals
