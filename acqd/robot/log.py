"""Robot logs: joint angles over the controller's clock, and whatever else the controller recorded."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.robot.description import LogColumns, RobotDescription
from acqd.robot.table import Table, read_table

_DAY_S = 86_400.0
_PER_AXIS = ("q", "qd", "tau", "current", "temperature")
_GENERIC = LogColumns(
    format="csv",
    q="q{1}",
    qd="qd{1}",
    tau="tau{1}",
    current="current{1}",
    temperature="temperature{1}",
    tool="tool",
    brake="brake",
)
"""The header every robot may use: time, q1..qn, qd1..qn, tau1.., current1.., temperature1.., tool, brake."""


@dataclass(frozen=True, slots=True)
class RobotLog:
    """One recording with the rows of the file: not resampled, not sorted, not repaired."""

    path: Path
    time: Floats
    """[T] s of the controller's clock, counted from 1970 or from any other origin."""
    q: Floats
    """[T, axes] rad."""
    qd: Floats | None = None
    """[T, axes] rad/s."""
    tau: Floats | None = None
    """[T, axes] Nm."""
    current: Floats | None = None
    """[T, axes] A."""
    temperature: Floats | None = None
    """[T, axes] degC."""
    signals: dict[str, Floats] = field(default_factory=dict)
    """`tool` and `brake` [T], 0 or 1, where recorded (brake 1: open)."""


def read_log(path: Path, robot: RobotDescription) -> RobotLog:
    """Read a DataRecorder text, an RTDE CSV or a CSV with the generic header, as `robot` names its columns.

    Raises InputError that names the row and column of what is wrong.
    """
    table = read_table(path)
    for layout in [*robot.log, _GENERIC]:
        columns = _match(layout, table, robot.axes)
        if columns is not None:
            return _assemble(path, table, columns, layout, robot)
    raise InputError(path, _why_not(table, robot))


Columns = dict[str, list[int]]


def _match(layout: LogColumns, table: Table, axes: int) -> Columns | None:
    """Column numbers per quantity, or None when this layout is not the file's."""
    if not layout.header:
        return _in_order(layout, table, axes) if table.header is None else None
    if table.header is None:
        return None
    where = {name: number for number, name in enumerate(table.header)}
    columns: Columns = {}
    for name in _PER_AXIS:
        pattern = getattr(layout, name)
        names = [pattern.format(axis, axis + 1) for axis in range(axes)] if pattern else []
        if names and all(column in where for column in names):
            columns[name] = [where[column] for column in names]
    clock = [layout.time_s, layout.time_ns] if layout.time_s and layout.time_ns else [layout.time]
    if "q" not in columns or not all(name in where for name in clock):
        return None
    columns["time"] = [where[name] for name in clock if name]
    for name in ("tool", "brake"):
        column = getattr(layout, name)
        if column in where:
            columns[name] = [where[column]]
    return columns


def _in_order(layout: LogColumns, table: Table, axes: int) -> Columns | None:
    columns: Columns = {}
    at = 0
    for name in layout.columns:
        count = 1 if name in ("time", "tool", "brake") else axes
        columns[name] = list(range(at, at + count))
        at += count
    return columns if at == table.values.shape[1] else None


def _assemble(path: Path, table: Table, columns: Columns, layout: LogColumns, robot: RobotDescription) -> RobotLog:
    def values(name: str) -> Floats | None:
        return table.values[:, columns[name]] if name in columns else None

    clock, q = values("time"), values("q")
    assert clock is not None and q is not None
    for name in ("time", "q"):
        bad = np.argwhere(~np.isfinite(table.values[:, columns[name]]))
        if len(bad):
            row, column = bad[0]
            raise InputError(path, f"row {table.line(row)}: {name} column {column + 1} is empty or no number")
    time = clock[:, 0] + clock[:, 1] * 1e-9 if clock.shape[1] == 2 else clock[:, 0] * layout.time_unit_s
    _check_angles(path, q, robot)
    signals: dict[str, Floats] = {
        name: table.values[:, columns[name][0]] for name in ("tool", "brake") if name in columns
    }
    others = {name: values(name) for name in _PER_AXIS[1:]}
    return RobotLog(path, time, q, **others, signals=signals)


def _check_angles(path: Path, q: Floats, robot: RobotDescription) -> None:
    """Raises InputError for angles beyond the limits: they are in degrees, or of another robot."""
    allowance = np.full(robot.axes, np.radians(2.0))
    allowance[list(robot.sliding)] = 0.02  # m
    turns = np.maximum(np.abs(robot.lower), np.abs(robot.upper)) + allowance
    # axes with an unlimited or multi-turn range count further turns: a whole turn more is no error
    revolute = np.array([not joint.slides for joint in robot.joint])
    turns = np.where((turns > np.radians(355)) & revolute, np.inf, turns)
    worst = np.abs(q).max(axis=0)
    beyond = np.flatnonzero(worst > turns)
    if not len(beyond):
        return
    axis = int(beyond[0])
    if not revolute[axis]:
        name, limit = robot.joint[axis].name, max(abs(robot.lower[axis]), abs(robot.upper[axis]))
        raise InputError(path, f"{name} reaches {worst[axis]:.4g} m, but its limit is {limit:g} m; write metres")
    limit = np.degrees(robot.upper[axis])
    advice = f"{robot.joint[axis].name} reaches {worst[axis]:.4g} rad, but its limit is {limit:.0f} deg"
    if (np.radians(worst) <= turns).all() and worst.max() > 20:
        raise InputError(path, f"{advice}; the angles look like degrees: write radians")
    raise InputError(path, f"{advice}; is this a log of {robot.name}?")


def _why_not(table: Table, robot: RobotDescription) -> str:
    """Why no layout of `robot` fits the table: a sentence for the user."""
    if table.header is None:
        return f"has no header and {table.values.shape[1]} columns; expected a header time,q1..q{robot.axes}"
    numbered: dict[str, set[int]] = {}
    for name in table.header:
        digits = re.fullmatch(r"(.*?)(\d+)(\D*)", name)
        if digits:
            numbered.setdefault(digits[1] + "#" + digits[3], set()).add(int(digits[2]))
    patterns = [layout.q.format("#", "#") for layout in [*robot.log, _GENERIC] if layout.header]
    for pattern in patterns:
        count = len(numbered.get(pattern, ()))
        if count and count != robot.axes:
            return f"has {count} columns {pattern.replace('#', 'N')}, but {robot.name} has {robot.axes} axes"
    expected = " or ".join([f"time,q1..q{robot.axes}", *patterns[:-1]])
    return (
        f"has none of the columns a log of {robot.name} has ({expected}); "
        f"its first columns are {', '.join(table.header[:4])}"
    )


def in_time(log: RobotLog) -> tuple[Floats, NDArray[np.int64]]:
    """The distinct times in rising order, and the row of each. Raises InputError for a jump of more than a day."""
    order = np.argsort(log.time, kind="stable")
    stamps, first = np.unique(log.time[order], return_index=True)
    rows = np.asarray(order[first], dtype=np.int64)
    steps = np.diff(stamps)
    if len(steps) and steps.max() > _DAY_S:
        row = int(rows[int(steps.argmax())]) + 1
        raise InputError(
            log.path, f"time jumps by {steps.max() / _DAY_S:.0f} days after data row {row}: remove the wrong rows"
        )
    return stamps, rows


def require_rising(log: RobotLog) -> None:
    """Raises InputError when the time does not rise from row to row: for uses that cannot sort or drop rows."""
    wrong = np.flatnonzero(np.diff(log.time) <= 0)
    if len(wrong):
        row = int(wrong[0]) + 1
        raise InputError(
            log.path,
            f"time goes from {log.time[row - 1]:.6f} s to {log.time[row]:.6f} s at data row {row + 1} "
            f"({len(wrong)} such rows); expected rising time: sort the rows and drop duplicates",
        )
