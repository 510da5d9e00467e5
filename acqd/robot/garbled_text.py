"""What a user should know of garbled rows: why a log with many is refused, and which few were left out."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription
from acqd.robot.garbled import BEYOND, beyond_limit, limits
from acqd.robot.table import Table

_NO_TIMES = 0.9
"""Share of rows without a time beyond which times are of another form."""
_NAMED_ROWS = 5
_DEGREES = 20.0
"""Angle [rad] from which on degrees are likelier than turns."""
_MANY = 0.1
"""Share of the rows with such an angle."""


def refusal(table: Table, q: Floats, faults: dict[int, str], robot: RobotDescription, recorded: Floats) -> str:
    """Why a log with many garbled rows is refused: degrees, another robot, or damage.

    `recorded` [T, axes]: angles as in the log; `q`: without jumps by whole turns.
    """
    kinds = [text.split(" is ")[0] for text in faults.values()]
    usual = max(set(kinds), key=kinds.count)  # a line of units, say, is a fault, but not why a log is refused
    row = next(row for row, kind in zip(faults, kinds, strict=True) if kind == usual)
    text = faults[row]
    if usual == "time" and "no number" in text and kinds.count(usual) > _NO_TIMES * len(q):
        return (
            f"row {table.line(row)}: its times are neither numbers nor dates of the form 2026-01-27T08:00:00.000Z: "
            "write seconds, or such dates"
        )
    share = f" ({len(faults)} of {len(q)} rows are garbled)" if len(faults) > 1 else ""
    worst = np.abs(q).max(axis=0, initial=0.0, where=np.isfinite(q))
    beyond = np.flatnonzero(worst > limits(robot))
    known = np.abs(recorded).max(axis=0, initial=0.0, where=np.isfinite(recorded))
    turning = [axis for axis in beyond if known[axis] <= limits(robot)[axis]]
    if turning and len(turning) == len(beyond):
        name = robot.joint[turning[0]].name
        return (
            f"{name} turns on beyond its limits where its angle jumps by whole turns, to {worst[turning[0]]:.4g} rad: "
            "if it has no stop, write limits_deg = [-360, 360] in the robot's description, which count as none"
        )
    often = (np.abs(q) > _DEGREES).any(axis=1).mean() > _MANY  # damage makes few such rows
    if often and "no number" not in text and (np.radians(worst) <= limits(robot)).all():
        axis = int(beyond[0]) if len(beyond) else int(worst.argmax())
        text = beyond_limit(robot, axis, float(worst[axis]))
        remedy = 'write radians, or angles = "deg" in [[log]] of the robot\'s description'
        return f"{text}; the angles look like degrees: {remedy}"
    if BEYOND not in text or not len(beyond):
        return f"row {table.line(row)}: {text}{share}"
    text = beyond_limit(robot, int(beyond[0]), float(worst[beyond[0]]))
    return f"{text}; is this a log of {robot.name}?"


def note(table: Table, faults: dict[int, str]) -> str:
    """Which rows were left out, and why; empty if none were."""
    if not faults:
        return ""
    rows = sorted(faults)
    named = ", ".join(str(table.line(row)) for row in rows[:_NAMED_ROWS])
    more = f" and {len(rows) - _NAMED_ROWS} more" if len(rows) > _NAMED_ROWS else ""
    word = "row" if len(rows) == 1 else "rows"
    return f"{len(rows)} of {len(table.lines)} rows garbled and left out: {word} {named}{more} ({faults[rows[0]]})"
