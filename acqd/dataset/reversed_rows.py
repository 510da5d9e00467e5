"""Whether rows are in reverse order of time: an export of the newest row first, whose times were written new.

Friction and copper losses do not know the direction of time, but lifting and lowering, speeding up and braking do. The
regression of the power that judges the order of the axes judges the order of the rows: its weights of
mechanical power are not negative (ADR 101).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acqd.dataset.axis_order import best_of
from acqd.dataset.merge import Recording
from acqd.dataset.order_fit import EXPLAINED, FEWEST_BLOCKS, GAIN_BY_POWER, Fit, OrderSample, pieces, scale_of_torques
from acqd.dataset.rejoined import rejoined
from acqd.robot.description import RobotDescription

_MIRRORED = {
    "the rows of each log": (True, True),
    "the angles of each log": (True, False),
}
"""What is reversed -> whether that are the angles and the power."""


def reversed_rows(robot: RobotDescription, recordings: Sequence[Recording]) -> str:
    """What is in reverse order of time, as a sentence; empty if nothing is clearly better explained so."""
    logged = tuple(range(robot.axes))
    scale, whole = scale_of_torques(guessed=True), rejoined(recordings, robot.axes)
    as_logged = Fit(robot, list(_samples(whole, robot.axes, turned=False, power_turned=False)), scale)
    if as_logged.blocks < FEWEST_BLOCKS:
        return ""
    for what, (turned, power_turned) in _MIRRORED.items():
        other = Fit(robot, list(_samples(whole, robot.axes, turned=turned, power_turned=power_turned)), scale)
        gain, errors = as_logged.gain_of(other, logged)
        clearly = best_of(len(_MIRRORED), as_logged.blocks)
        if errors > clearly and gain > GAIN_BY_POWER and other.explained(logged) > EXPLAINED:
            return f"{what} are in reverse order of time, by the power that they explain: sort them by their own times"
    return ""


def _samples(logs: Sequence[Recording], axes: int, *, turned: bool, power_turned: bool) -> Iterator[OrderSample]:
    """The rows that are known in both directions of time, with angles or power turned.

    Blocks of turned rows are compared with those of other seconds: their scatter, and so the margin, is larger. A wrist
    that turns alone in a real log gains as much as the limit, and only this margin keeps it.
    """
    for log in logs:
        q, P = log.of_axes("q", axes), log.columns["P"]
        q, P = (q[::-1] if turned else q), (P[::-1] if power_turned else P)
        yield from pieces(q, P, log.valid & log.valid[::-1], float(np.median(np.diff(log.time_ns))) * 1e-9)
