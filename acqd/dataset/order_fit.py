"""The same regression of torques, currents or power in any order, sign or zero of the axes, and its likelihood.

Gravity and inertia of the described body belong to the joints in their order, friction does not. Residuals are compared
block by block (Q. H. Vuong, Likelihood ratio tests for model selection and non-nested hypotheses, Econometrica 57,
1989).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from acqd.arrays import Floats
from acqd.numerics import runs_of_true
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inertial_parameters, inverse_dynamics
from acqd.robot.newton_euler import Chain, joint_torque

Order: TypeAlias = tuple[int, ...]
"""For each axis, the column that holds its values."""

CLEARLY = 3.0
"""Standard errors of the mean difference of two log likelihoods."""
GAIN_BY_POWER = 0.1
"""Nats a row that another order must gain in the power, in which friction hides more: two wrist joints exchanged gain
0.18, the last two 0.03."""
EXPLAINED = 0.5
"""Share of the variance of the witnesses that a better order must explain: noise has no order."""
FEWEST_BLOCKS = 10
"""Blocks from which on their scatter is known."""
_TORQUE_SCALE = (0.5, 2.0)
"""Logged over computed torque."""
GUESSED_SCALE = (0.2, 5.0)
"""The same for currents of drives whose torque constant is guessed."""
_BLOCK_S = 2.0
_MOST_ROWS = 1500
_EDGE = 2
"""Rows at either end of a piece whose accelerations are one-sided."""
SIGN_SPEED = 0.02  # rad/s, width of the smoothed sign of the speed
_RESOLVED = 0.02
"""Share of the scatter of torques or power below which residuals count alike: no description is that exact."""


@dataclass(frozen=True, slots=True)
class OrderSample:
    """A piece of motion without gaps, and what witnesses the order of its axes."""

    q: Floats
    """[T, axes] rad or m, `step_s` apart."""
    seen: Floats
    """[T, axes] Nm or N, or [T] W."""
    step_s: float


def pieces(q: Floats, seen: Floats, known: NDArray[np.bool_], step_s: float) -> Iterator[OrderSample]:
    """The runs of known rows [T] of angles [T, axes] and witnesses that are long enough."""
    for start, end in runs_of_true(known):
        if (end - start) * step_s >= _BLOCK_S and end - start > 4 * _EDGE:
            yield OrderSample(q[start:end], seen[start:end], step_s)


def scale_of_torques(*, guessed: bool) -> tuple[float, float]:
    """The possible range of logged over computed torque; `guessed`: currents times guessed torque constants."""
    return GUESSED_SCALE if guessed else _TORQUE_SCALE


def share_of(
    robot: RobotDescription, samples: Sequence[OrderSample], order: Order | None = None, *, guessed: bool = False
) -> float:
    """Share of the variance of the witnesses that an order (None: as logged) explains, in the mean over them."""
    scale = scale_of_torques(guessed=guessed)
    return Fit(robot, samples, scale).mean_explained(order or tuple(range(robot.axes)))


def share_of_weight(robot: RobotDescription, samples: Sequence[OrderSample]) -> float:
    """Variance of the power that lifts and lowers the described masses, over that of the power [T] W of the samples."""
    lifting, seen = [], []
    for sample in samples:
        qd = np.gradient(sample.q, sample.step_s, axis=0)
        lifting.append((inverse_dynamics(robot, sample.q, 0 * qd, 0 * qd) * qd).sum(axis=1))
        seen.append(sample.seen)
    return float(np.var(np.concatenate(lifting)) / max(float(np.var(np.concatenate(seen))), 1e-12))


def shares_of(robot: RobotDescription, samples: Sequence[OrderSample]) -> Floats:
    """[axes] share of the variance of the torques of each axis that the order as logged explains."""
    return Fit(robot, samples, _TORQUE_SCALE).shares(tuple(range(robot.axes)))


class Fit:
    """Residuals of the same rows in any order of the axes."""

    def __init__(self, robot: RobotDescription, samples: Sequence[OrderSample], scale: tuple[float, float]) -> None:
        self.chain, self.parameters, self._scale = Chain.of(robot), inertial_parameters(robot), scale
        rows = sum(len(sample.q) for sample in samples)
        thin = max(1, -(-rows // _MOST_ROWS))
        parts = []
        blocks: list[NDArray[np.int64]] = []
        number = 0
        for sample in samples:
            qd = np.gradient(sample.q, sample.step_s, axis=0)
            qdd = np.gradient(qd, sample.step_s, axis=0)
            some = np.arange(_EDGE, len(sample.q) - _EDGE, thin)
            parts.append((sample.q[some], qd[some], qdd[some], sample.seen[some]))
            block = number + (some * sample.step_s / _BLOCK_S).astype(np.int64)
            blocks.append(block)
            number = int(block[-1]) + 1 if len(block) else number
        self._known: dict[Order, Floats] = {}
        self._block = np.concatenate(blocks) if blocks else np.zeros(0, np.int64)
        self.blocks = len(np.unique(self._block))
        if self.blocks:
            self.q, self.qd, self.qdd, self.seen = (np.concatenate(each) for each in zip(*parts, strict=True))

    def with_parameters(self, parameters: Floats) -> Fit:
        """The same rows of an arm with other inertial parameters."""
        other = copy(self)
        other.parameters, other._known = parameters, {}
        return other

    def gain(self, one: Order, other: Order) -> tuple[float, float]:
        """Mean log likelihood [nats a row] that `other` gains over `one`, and its number of standard errors."""
        return self._gain(self._log_likelihood(other) - self._log_likelihood(one))

    def gain_of(self, changed: Fit, order: Order) -> tuple[float, float]:
        """The same that other angles in the same rows gain."""
        return self._gain(changed._log_likelihood(order) - self._log_likelihood(order))

    def _gain(self, difference: Floats) -> tuple[float, float]:
        counts = np.bincount(self._block)
        sums = np.bincount(self._block, difference)[counts > 0]
        error = float(np.std(sums)) * np.sqrt(len(sums))
        return float(difference.mean()), float(sums.sum()) / max(error, 1e-9)

    def explained(self, order: Order) -> float:
        """Share of the variance of the witnesses that this order explains, in the median over them."""
        return float(np.median(self.shares(order)))

    def mean_explained(self, order: Order) -> float:
        """The same in the mean: one or two axes that are not explained count."""
        return float(np.mean(self.shares(order)))

    def shares(self, order: Order) -> Floats:
        """The same of each witness."""
        if not self.blocks:
            return np.ones(1)
        left = self._left(order)
        seen = self.seen if self.seen.ndim == 2 else self.seen[:, None]
        return np.asarray(1 - (left**2).mean(axis=0) / (seen.var(axis=0)[self._columns(order)] + 1e-12))

    def torques(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """[T, axes] Nm or N of the arm without friction and rotors."""
        return joint_torque(self.chain, self.parameters, q, qd, qdd)

    def _columns(self, order: Order) -> list[int]:
        """Columns of the witnesses in the order of the residuals."""
        return [0] if self.seen.ndim == 1 else list(range(len(order)))

    def _left(self, order: Order) -> Floats:
        """[T, witnesses] residuals."""
        columns = list(order)
        q, qd, qdd = self.q[:, columns], self.qd[:, columns], self.qdd[:, columns]
        tau = self.torques(q, qd, qdd)
        if self.seen.ndim == 1:
            return self._power_left(tau, qd, qdd)[:, None]
        return self._torque_left(tau, qd, qdd, columns)

    def _log_likelihood(self, order: Order) -> Floats:
        """[T] of normal residuals whose deviation is their own."""
        if order not in self._known:
            left = self._left(order)
            variance = (left**2).mean(axis=0) + (_RESOLVED * self.seen.std(axis=0)) ** 2 + 1e-12
            self._known[order] = np.asarray(-0.5 * (np.log(variance) + left**2 / variance).sum(axis=1))
        return self._known[order]

    def _torque_left(self, tau: Floats, qd: Floats, qdd: Floats, columns: list[int]) -> Floats:
        """[T, columns]: what computed torque, friction, rotor inertia and an offset leave of the witnesses."""
        left = np.zeros_like(tau)
        for axis, column in enumerate(columns):
            seen = self.seen[:, column]
            own = (tau[:, axis], np.tanh(qd[:, axis] / SIGN_SPEED), qd[:, axis], qdd[:, axis], np.ones(len(tau)))
            X = np.column_stack(own)
            weights = np.linalg.lstsq(X, seen, rcond=None)[0]
            possible = float(np.clip(weights[0], *self._scale))
            if possible != weights[0]:
                rest = seen - possible * X[:, 0]
                weights = np.concatenate([[possible], np.linalg.lstsq(X[:, 1:], rest, rcond=None)[0]])
            left[:, column] = seen - X @ weights
        return left

    def _power_left(self, tau: Floats, qd: Floats, qdd: Floats) -> Floats:
        """[T]: what mechanical power, friction, copper losses and rotors leave of the power; no weight is negative."""
        turned = tau * np.tanh(qd / SIGN_SPEED)
        rotors = qd * qdd
        X = np.column_stack(
            [np.ones(len(tau)), (tau * qd).sum(axis=1), np.abs(qd), qd**2, tau**2, np.abs(tau * qd)]
            + [np.maximum(sign * each, 0.0) for each in (turned, rotors) for sign in (1, -1)]
        )
        scale = np.sqrt((X**2).mean(axis=0)) + 1e-12
        weights, _ = nnls(X / scale, self.seen)
        return np.asarray(self.seen - X / scale @ weights)
