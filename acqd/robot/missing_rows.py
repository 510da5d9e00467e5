"""Rows at even times between which rows are missing, or where two recordings meet.

Within its accelerations a joint moves from one row to the next as far as in the steps before and after, on average, but
for a x step^2 (a: its acceleration, from full braking to full drive). Where it moves farther for one step only, the
rows are no neighbours in time, although none of them is faster than the joint can be.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription
from acqd.robot.garbled import TOO_FAST, resolution

_NOISE = 0.2
"""Share of what is no jump between any rows: here the joint's motion around the step is known."""
_QUANTUM = 2.0
"""Steps in which angles are written: what rounding adds at most to the difference of a step from the mean of the two
around it, in which four angles have weights of 1.5, 1.5, 0.5 and 0.5."""
_EVEN = 0.01
"""Of a step, by which steps may differ."""


def missing_rows(time: Floats, q: Floats, q_step: Floats, robot: RobotDescription) -> tuple[int, str] | None:
    """The first row before which rows of `time` [T] s and `q` [T, axes] are missing, and why; None without one.

    `q_step` [axes] is the step in which angles are written, of which a joint that hardly moves shows nothing.
    """
    step, moved = np.diff(time), np.diff(q, axis=0)
    if len(step) < 3:
        return None
    usual = float(np.median(step))
    around = (moved[:-2] + moved[2:]) / 2
    by_drive = TOO_FAST * robot.acceleration * usual**2
    unsure = _NOISE * resolution(robot) + _QUANTUM * q_step.max(initial=0.0)
    farthest = by_drive + unsure + np.abs(around)
    even = np.abs(step - usual) < _EVEN * usual
    beyond = (np.abs(moved[1:-1] - around) > farthest) & (np.abs(moved[1:-1]) > np.abs(around))
    jumps = beyond & (even[:-2] & even[1:-1] & even[2:])[:, None]
    if not jumps.any():
        return None
    row, axis = (int(index) for index in np.argwhere(jumps)[0])
    joint = robot.joint[axis]
    far, near, unit = (
        (moved[row + 1, axis], around[row, axis], "m") if joint.slides
        else (np.degrees(moved[row + 1, axis]), np.degrees(around[row, axis]), "deg")
    )  # fmt: skip
    return row + 2, (
        f"{joint.name} moves {far:+.3g} {unit} from the row before, but {near:+.3g} {unit} in the steps around it: "
        "rows are missing there"
    )
