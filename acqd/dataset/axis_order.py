"""Whether the columns of all axes are in the order of the robot's axes: judged by torques, currents or power.

Columns in another order, in angles, speeds and currents alike, are a possible motion of the robot. What contradicts
them is physics: gravity and inertia of the described body belong to the joints in their order, friction does not. The
same regression is fitted in each order, and residuals are compared block by block (Q. H. Vuong, Likelihood ratio tests
for model selection and non-nested hypotheses, Econometrica 57, 1989). Where neither order is clearly better, the order
is not confirmed, and a line says so.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from acqd.arrays import Floats
from acqd.numerics import runs_of_true
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inertial_parameters
from acqd.robot.newton_euler import Chain, joint_torque, joint_torques

Order: TypeAlias = tuple[int, ...]
"""For each axis, the column that holds its values."""

_CLEARLY = 3.0
"""Standard errors of the mean difference of two orders' log likelihoods."""
_GAIN = 0.2
"""Nats a row that another order must gain before logs are refused. In real logs of a UR10e and a Kinova Gen3 no order
gains more than 0.1 with a clear difference; two wrist joints exchanged gain 0.4 to 0.8 by currents."""
_GAIN_BY_POWER = 0.1
"""The same for the power, in which friction hides more: two wrist joints exchanged gain 0.18, the last two 0.03."""
_FEWEST_BLOCKS = 10
"""Blocks from which on their scatter is known."""
_BLOCK_S = 2.0
_MOST_ROWS = 1500
_EDGE = 2
"""Rows at either end of a piece whose accelerations are one-sided."""
_SIGN_SPEED = 0.02  # rad/s, width of the smoothed sign of the speed
_RESOLVED = 0.02
"""Share of the scatter of torques or power below which residuals count alike: no description is that exact."""
_TORQUE_SCALE = (0.5, 2.0)
"""Logged over computed torque."""
_GUESSED_SCALE = (0.2, 5.0)
"""The same for currents of drives whose torque constant is guessed."""
_MOST_STEPS = 4
_HEAVIEST = 0.5
"""Share of the arm's mass that no payload has: rated payloads of shipped arms are at most about half."""
_ALREADY = 0.97
"""Share of the variance that the angles as logged explain at most where another sign or zero is looked for."""
_GAIN_OF_ZEROS = 0.3
"""Nats a row that another sign or zero must gain."""
_EXPLAINED = 0.5
"""Share of the variance of the witnesses that a better order must explain: noise has no order."""


@dataclass(frozen=True, slots=True)
class OrderSample:
    """A piece of motion without gaps, and what witnesses the order of its axes."""

    q: Floats
    """[T, axes] rad or m, `step_s` apart."""
    seen: Floats
    """[T, axes] Nm or N, or [T] W."""
    step_s: float


@dataclass(frozen=True, slots=True)
class ZeroJudgement:
    """An axis whose sign or zero fits the description better otherwise."""

    axis: int
    sign: int
    offset: float
    """rad that are added to the angle after the sign."""
    share: float = 0.0
    """Of the variance of the witnesses that it explains."""

    def text(self, robot: RobotDescription) -> str:
        """The line on that axis."""
        name = robot.joint[self.axis].name
        what = "the other sign" if self.sign < 0 and not self.offset else f"{np.degrees(self.offset):+.0f} deg added"
        if self.sign < 0 and self.offset:
            what = f"the other sign and {what}"
        return (
            f"{robot.name} explains them better with {what} in the angle of {name}: its sign or zero is another "
            "one than the description's; convert the logs, or describe the robot as it counts"
        )


@dataclass(frozen=True, slots=True)
class OrderJudgement:
    """What the witnesses say of the order of the columns."""

    better: Order | None
    """The order that fits clearly better than the columns as logged; None if none does."""
    unsure: frozenset[Order] = frozenset()
    """Other orders that do not fit clearly worse."""

    def text(self, robot: RobotDescription) -> str:
        """The line on the order that fits better; `better` is not None."""
        assert self.better is not None
        moved = [axis for axis, column in enumerate(self.better) if axis != column]
        names = [robot.joint[axis].name for axis in moved]
        what = f"with {names[0]} and {names[1]} exchanged"
        if len(moved) > 2:
            columns = (f"{robot.joint[axis].name} from column {self.better[axis] + 1}" for axis in moved)
            what = f"with {', '.join(columns)}"
        return (
            f"{robot.name} explains them better {what}: the columns of these joints are in another order, as in "
            "messages that sort joints by name; write them in the order of the axes"
        )

    def note(self, robot: RobotDescription, witness: str) -> str:
        """The line on axes whose order is not confirmed; empty if all are."""
        groups = _groups(self.unsure)
        if not groups:
            return ""
        named = "; ".join(_listed([robot.joint[axis].name for axis in group]) for group in groups)
        what = "the joints" if len(groups[0]) == robot.axes else named
        return f"the order of {what} is not confirmed by these logs ({witness}): check the columns"

    def together(self, other: OrderJudgement) -> OrderJudgement:
        """The judgement of two witnesses: an order that either rules out is ruled out."""
        return OrderJudgement(None, self.unsure & other.unsure)


def judge_order(robot: RobotDescription, samples: Sequence[OrderSample], *, guessed: bool = False) -> OrderJudgement:
    """Compares the columns as logged with exchanges and cycles of two and three axes, and all axes turned or reversed.

    `guessed`: the torques are currents times guessed torque constants.
    """
    axes = robot.axes
    logged = tuple(range(axes))
    if axes == 1:
        return OrderJudgement(None)
    others = [order for order in _orders(axes) if order != logged]
    fit = _Fit(robot, samples, _GUESSED_SCALE if guessed else _TORQUE_SCALE)
    if fit.blocks < _FEWEST_BLOCKS:
        return OrderJudgement(None, frozenset(others))
    gains = {order: fit.gain(logged, order) for order in others}
    best = max(gains, key=lambda order: gains[order][0] if gains[order][1] > _CLEARLY else -np.inf)
    least = _GAIN_BY_POWER if samples[0].seen.ndim == 1 else _GAIN
    if gains[best][1] > _CLEARLY and gains[best][0] > least and fit.explained(best) > _EXPLAINED:
        return OrderJudgement(_climbed(fit, best))
    return OrderJudgement(None, frozenset(order for order, (_, errors) in gains.items() if errors > -_CLEARLY))


def judge_zeros(
    robot: RobotDescription, samples: Sequence[OrderSample], *, guessed: bool = False
) -> ZeroJudgement | None:
    """The axis with another sign, or another zero by a quarter or half turn, that fits clearly better; None without.

    Torques and currents of a reversed axis are reversed, too.
    """
    scale = _GUESSED_SCALE if guessed else _TORQUE_SCALE
    logged = tuple(range(robot.axes))
    as_logged = _Fit(robot, samples, scale)
    if as_logged.blocks < _FEWEST_BLOCKS or as_logged.explained(logged) > _ALREADY:
        return None
    best: tuple[float, ZeroJudgement] | None = None
    by_power = samples[0].seen.ndim == 1
    for axis, joint in enumerate(robot.joint):
        if joint.slides:
            continue
        for sign, turns in ((-1, 0), (1, 1), (1, -1), (1, 2), (-1, 1), (-1, -1), (-1, 2)):
            other = ZeroJudgement(axis, sign, turns * np.pi / 2)
            for seen_sign in (1,) if by_power or sign > 0 else (1, -1):
                changed = _Fit(robot, [_turned(sample, other, seen_sign) for sample in samples], scale)
                gain, errors = as_logged.gain_of(changed, logged)
                better = gain > _GAIN_OF_ZEROS and errors > _CLEARLY and changed.explained(logged) > _EXPLAINED
                if better and (best is None or gain > best[0]):
                    best = gain, replace(other, share=changed.mean_explained(logged))
    return best[1] if best else None


def _turned(sample: OrderSample, zero: ZeroJudgement, seen_sign: int) -> OrderSample:
    q = sample.q.copy()
    q[:, zero.axis] = zero.sign * q[:, zero.axis] + zero.offset
    seen = sample.seen
    if seen_sign < 0:
        seen = seen.copy()
        seen[:, zero.axis] *= -1
    return OrderSample(q, seen, sample.step_s)


def share_of(
    robot: RobotDescription, samples: Sequence[OrderSample], order: Order | None = None, *, guessed: bool = False
) -> float:
    """Share of the variance of the witnesses that an order (None: as logged) explains, in the mean over them."""
    scale = _GUESSED_SCALE if guessed else _TORQUE_SCALE
    return _Fit(robot, samples, scale).mean_explained(order or tuple(range(robot.axes)))


def shares_of(robot: RobotDescription, samples: Sequence[OrderSample]) -> Floats:
    """[axes] share of the variance of the torques of each axis that the order as logged explains."""
    return _Fit(robot, samples, _TORQUE_SCALE).shares(tuple(range(robot.axes)))


@dataclass(frozen=True, slots=True)
class Better:
    """How another robot explains the witnesses, compared with the one that is given."""

    gain: float
    """Nats a row."""
    clearly: bool
    slope: float
    """Logged over computed torque of the given robot, all axes together."""
    slope_of_other: float


def explains_better(robot: RobotDescription, other: RobotDescription, samples: Sequence[OrderSample]) -> Better | None:
    """Whether `other` explains torques better than `robot` with any payload; None where the samples are too short."""
    logged = tuple(range(robot.axes))
    own, its = (_Fit(each, samples, _GUESSED_SCALE) for each in (robot, other))
    if own.blocks < _FEWEST_BLOCKS:
        return None
    own.take_payload()
    gain, errors = own.gain_of(its, logged)
    return Better(gain, gain > _GAIN_BY_POWER and errors > _CLEARLY, own.slope(), its.slope())


def pieces(q: Floats, seen: Floats, known: NDArray[np.bool_], step_s: float) -> Iterator[OrderSample]:
    """The runs of known rows [T] of angles [T, axes] and witnesses that are long enough."""
    for start, end in runs_of_true(known):
        if (end - start) * step_s >= _BLOCK_S and end - start > 4 * _EDGE:
            yield OrderSample(q[start:end], seen[start:end], step_s)


class _Fit:
    """Residuals of the same rows in any order of the axes."""

    def __init__(self, robot: RobotDescription, samples: Sequence[OrderSample], scale: tuple[float, float]) -> None:
        self._chain, self._parameters, self._scale = Chain.of(robot), inertial_parameters(robot), scale
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
            self._q, self._qd, self._qdd, self._seen = (np.concatenate(each) for each in zip(*parts, strict=True))

    def gain(self, one: Order, other: Order) -> tuple[float, float]:
        """Mean log likelihood [nats a row] that `other` gains over `one`, and its number of standard errors."""
        return self._gain(self._log_likelihood(other) - self._log_likelihood(one))

    def gain_of(self, changed: _Fit, order: Order) -> tuple[float, float]:
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
        seen = self._seen if self._seen.ndim == 2 else self._seen[:, None]
        return np.asarray(1 - (left**2).mean(axis=0) / (seen.var(axis=0)[self._columns(order)] + 1e-12))

    def take_payload(self) -> None:
        """Let the arm carry the mass and first moment at its last link that fit best, if they are a payload's.

        Torques are linear in both: one scale of all torques, and each axis' friction, rotor and offset are fitted too.
        """
        body = slice(len(self._parameters) - 10, len(self._parameters) - 6)
        units = np.zeros((5, len(self._parameters)))
        units[0] = self._parameters
        units[1:, body] = np.eye(4)
        torques = joint_torques(self._chain, units, self._q, self._qd, self._qdd)
        X, y = [], []
        for axis in range(self._q.shape[1]):
            others, seen = self._beside(axis), self._seen[:, axis]
            weight = 1 / (float(seen.std()) + 1e-12)
            own = torques[:, :, axis].T
            X.append(weight * (own - others @ (others.T @ own)))
            y.append(weight * (seen - others @ (others.T @ seen)))
        scale, *moments = np.linalg.lstsq(np.concatenate(X), np.concatenate(y), rcond=None)[0]
        heaviest = _HEAVIEST * float(self._parameters[::10].sum())
        if scale > 0 and 0 < moments[0] / scale < heaviest:
            self._parameters = self._parameters.copy()
            self._parameters[body] += np.array(moments) / scale

    def slope(self) -> float:
        """Logged over computed torque of all axes together, beside friction, rotor and an offset of each."""
        tau = self._torques(self._q, self._qd, self._qdd)
        product = square = 0.0
        for axis in range(tau.shape[1]):
            others = self._beside(axis)
            own = tau[:, axis] - others @ (others.T @ tau[:, axis])
            product += float(own @ self._seen[:, axis])
            square += float(own @ own)
        return product / max(square, 1e-12)

    def _beside(self, axis: int) -> Floats:
        """[T, 4] orthonormal columns of friction, rotor and offset of an axis."""
        qd, qdd = self._qd[:, axis], self._qdd[:, axis]
        columns, _ = np.linalg.qr(np.column_stack([np.tanh(qd / _SIGN_SPEED), qd, qdd, np.ones(len(qd))]))
        return np.asarray(columns)

    def _torques(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        return joint_torque(self._chain, self._parameters, q, qd, qdd)

    def _columns(self, order: Order) -> list[int]:
        """Columns of the witnesses in the order of the residuals."""
        return [0] if self._seen.ndim == 1 else list(range(len(order)))

    def _left(self, order: Order) -> Floats:
        """[T, witnesses] residuals."""
        columns = list(order)
        q, qd, qdd = self._q[:, columns], self._qd[:, columns], self._qdd[:, columns]
        tau = self._torques(q, qd, qdd)
        if self._seen.ndim == 1:
            return self._power_left(tau, qd, qdd)[:, None]
        return self._torque_left(tau, qd, qdd, columns)

    def _log_likelihood(self, order: Order) -> Floats:
        """[T] of normal residuals whose deviation is their own."""
        if order not in self._known:
            left = self._left(order)
            variance = (left**2).mean(axis=0) + (_RESOLVED * self._seen.std(axis=0)) ** 2 + 1e-12
            self._known[order] = np.asarray(-0.5 * (np.log(variance) + left**2 / variance).sum(axis=1))
        return self._known[order]

    def _torque_left(self, tau: Floats, qd: Floats, qdd: Floats, columns: list[int]) -> Floats:
        """[T, columns]: what computed torque, friction, rotor inertia and an offset leave of the witnesses."""
        left = np.zeros_like(tau)
        for axis, column in enumerate(columns):
            seen = self._seen[:, column]
            own = (tau[:, axis], np.tanh(qd[:, axis] / _SIGN_SPEED), qd[:, axis], qdd[:, axis], np.ones(len(tau)))
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
        turned = tau * np.tanh(qd / _SIGN_SPEED)
        rotors = qd * qdd
        X = np.column_stack(
            [np.ones(len(tau)), (tau * qd).sum(axis=1), np.abs(qd), qd**2, tau**2, np.abs(tau * qd)]
            + [np.maximum(sign * each, 0.0) for each in (turned, rotors) for sign in (1, -1)]
        )
        scale = np.sqrt((X**2).mean(axis=0)) + 1e-12
        weights, _ = nnls(X / scale, self._seen)
        return np.asarray(self._seen - X / scale @ weights)


def _climbed(fit: _Fit, order: Order) -> Order:
    """The order from which no further exchange gains clearly: several pairs may be exchanged."""
    for _ in range(_MOST_STEPS):
        after = [_exchanged(order, *pair) for pair in itertools.combinations(range(len(order)), 2)]
        gains = [fit.gain(order, each) for each in after]
        best = int(np.argmax([gain if errors > _CLEARLY else -np.inf for gain, errors in gains]))
        if gains[best][0] <= 0 or gains[best][1] <= _CLEARLY:
            break
        order = after[best]
    return order


def _exchanged(order: Order, one: int, other: int) -> Order:
    changed = list(order)
    changed[one], changed[other] = changed[other], changed[one]
    return tuple(changed)


def _orders(axes: int) -> list[Order]:
    """Exchanges of two columns, cycles of three, all columns turned by any number, and reversed."""
    orders = [tuple(np.roll(range(axes), turn).tolist()) for turn in range(1, axes)]
    orders.append(tuple(reversed(range(axes))))
    for count in (2, 3):
        for chosen in itertools.combinations(range(axes), count):
            for turn in range(1, count):
                order = list(range(axes))
                for k, axis in enumerate(chosen):
                    order[axis] = chosen[(k + turn) % count]
                orders.append(tuple(order))
    return list(dict.fromkeys(orders))


def _groups(orders: Iterable[Order]) -> list[tuple[int, ...]]:
    """Sets of axes that some of the orders move, joined where they share an axis."""
    groups: list[set[int]] = []
    for order in orders:
        moved = {axis for axis, column in enumerate(order) if axis != column}
        apart = [group for group in groups if not group & moved]
        groups = [*apart, moved.union(*(group for group in groups if group & moved))]
    return sorted(tuple(sorted(group)) for group in groups)


def _listed(names: list[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"
