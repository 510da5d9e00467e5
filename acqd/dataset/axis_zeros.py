"""Whether the sign or the zero of an axis is the description's: judged by torques, currents or power.

A reversed axis, and one whose zero is a quarter or half turn away, is a possible motion too, and is told from the
described one as another order of the columns is (`order_fit`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acqd.dataset.order_fit import CLEARLY, EXPLAINED, FEWEST_BLOCKS, Fit, OrderSample, scale_of_torques
from acqd.robot.description import RobotDescription

_ALREADY = 0.97
"""Share of the variance that the angles as logged explain at most where another sign or zero is looked for."""
_GAIN_OF_ZEROS = 0.3
"""Nats a row that another sign or zero must gain."""


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


def judge_zeros(
    robot: RobotDescription, samples: Sequence[OrderSample], *, guessed: bool = False
) -> ZeroJudgement | None:
    """The axis with another sign, or another zero by a quarter or half turn, that fits clearly better; None without.

    Torques and currents of a reversed axis are reversed, too.
    """
    scale = scale_of_torques(guessed=guessed)
    logged = tuple(range(robot.axes))
    as_logged = Fit(robot, samples, scale)
    if as_logged.blocks < FEWEST_BLOCKS or as_logged.explained(logged) > _ALREADY:
        return None
    best: tuple[float, ZeroJudgement] | None = None
    by_power = samples[0].seen.ndim == 1
    for axis, joint in enumerate(robot.joint):
        if joint.slides:
            continue
        for sign, turns in ((-1, 0), (1, 1), (1, -1), (1, 2), (-1, 1), (-1, -1), (-1, 2)):
            other = ZeroJudgement(axis, sign, turns * np.pi / 2)
            for seen_sign in (1,) if by_power or sign > 0 else (1, -1):
                changed = Fit(robot, [_turned(sample, other, seen_sign) for sample in samples], scale)
                gain, errors = as_logged.gain_of(changed, logged)
                better = gain > _GAIN_OF_ZEROS and errors > CLEARLY and changed.explained(logged) > EXPLAINED
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
