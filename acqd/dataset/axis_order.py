"""Whether the columns of all axes are in the order of the robot's axes: judged by torques, currents or power.

Columns in another order, in angles, speeds and currents alike, are a possible motion of the robot. What contradicts
them is physics: gravity and inertia of the described body belong to the joints in their order, friction does not. The
same regression is fitted in each order, and residuals are compared block by block (Q. H. Vuong, Likelihood ratio tests
for model selection and non-nested hypotheses, Econometrica 57, 1989). Where neither order is clearly better, the order
is not confirmed, and a line says so.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from acqd import student
from acqd.dataset.order_fit import (
    CLEARLY,
    EXPLAINED,
    FEWEST_BLOCKS,
    GAIN_BY_POWER,
    Fit,
    Order,
    OrderSample,
    scale_of_torques,
)
from acqd.robot.description import RobotDescription

_GAIN = 0.2
"""Nats a row that another order must gain before logs are refused. In real logs of a UR10e and a Kinova Gen3 no order
gains more than 0.1 with a clear difference; two wrist joints exchanged gain 0.4 to 0.8 by currents."""
_MOST_STEPS = 4
_BY_CHANCE = 0.02
"""Probability of a wrong order that fits as well as the logged one to be called better."""


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
    fit = Fit(robot, samples, scale_of_torques(guessed=guessed))
    if fit.blocks < FEWEST_BLOCKS:
        return OrderJudgement(None, frozenset(others))
    gains = {order: fit.gain(logged, order) for order in others}
    clearly = best_of(len(others), fit.blocks)
    ahead = {order: gain for order, (gain, errors) in gains.items() if errors > clearly and _has_witness(robot, order)}
    best = max(ahead, key=lambda order: ahead[order], default=logged)
    least = GAIN_BY_POWER if samples[0].seen.ndim == 1 else _GAIN
    if ahead and ahead[best] > least and fit.explained(best) > EXPLAINED:
        return OrderJudgement(_climbed(fit, robot, best))
    unsure = (order for order, (_, errors) in gains.items() if errors > -CLEARLY or not _has_witness(robot, order))
    return OrderJudgement(None, frozenset(unsure))


def _has_witness(robot: RobotDescription, order: Order) -> bool:
    """Whether the body of a joint that the order moves is described: guessed bodies neither contradict nor confirm."""
    return any(axis != column and not robot.joint[axis].is_guessed("link.mass") for axis, column in enumerate(order))


def best_of(orders: int, blocks: int) -> float:
    """Standard errors that the best of so many wrong orders is ahead by with a probability of `_BY_CHANCE`, at least.

    The best of sixty orders pays for the choice (Bonferroni), and few blocks know their own scatter badly (Student):
    with a minute of power and a payload that the description lacks, the best wrong order is 3 standard errors ahead.
    """
    return float(student.isf(_BY_CHANCE / orders, blocks - 1))


def _climbed(fit: Fit, robot: RobotDescription, order: Order) -> Order:
    """The order from which no further exchange gains clearly: several pairs may be exchanged."""
    logged = tuple(range(robot.axes))
    pairs = [pair for pair in itertools.combinations(logged, 2) if _has_witness(robot, _exchanged(logged, *pair))]
    for _ in range(_MOST_STEPS):
        after = [_exchanged(order, *pair) for pair in pairs]
        gains = [fit.gain(order, each) for each in after]
        best = int(np.argmax([gain if errors > CLEARLY else -np.inf for gain, errors in gains]))
        if gains[best][0] <= 0 or gains[best][1] <= CLEARLY:
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
