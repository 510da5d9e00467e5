"""Reads robot logs: garbled and doubtful rows are left out, times and angles put right, quantities judged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.robot.bag import is_bag, read_bag
from acqd.robot.clock_fault import clock_fault
from acqd.robot.columns import TITLES, angle_fault, at_zero, judged, on_off
from acqd.robot.description import LogColumns, RobotDescription
from acqd.robot.doubtful_rows import doubtful_rows
from acqd.robot.drawn_rows import drawn_every
from acqd.robot.garbled import FEW, garbled_rows, impossible_jump, limits, reach
from acqd.robot.garbled_text import note, refusal
from acqd.robot.integrated import from_speeds
from acqd.robot.joint_refresh import between_refreshes, frozen
from acqd.robot.last_line import LEFT_OUT
from acqd.robot.log import DAY_S, RobotLog, in_time
from acqd.robot.log_layout import LABELS, PER_AXIS, Columns, layout_of, more_axes, twice, why_not, word_columns
from acqd.robot.log_times import rebuilt, require_one_clock
from acqd.robot.motion_quality import MotionQuality
from acqd.robot.resolution import smoothed, smoothing_of, steps_of
from acqd.robot.table import Table, read_table
from acqd.robot.tool_point import check_tool_point
from acqd.robot.unwrapping import unwrapped


def read_log(path: Path, robot: RobotDescription) -> RobotLog:
    """Read a log whose columns `robot` names, or that has the generic header: text, Parquet, or a ROS bag.

    Garbled rows are left out if they are few, and the log's `note` names them. Raises InputError that names the row
    and column of what is wrong, UserError without the library that a format needs.
    """
    return log_of(path, read_bag(path, robot) if is_bag(path) else read_table(path, FEW, word_columns(robot)), robot)


def log_of(path: Path, table: Table, robot: RobotDescription) -> RobotLog:
    """The log in a table; `path` is its name in messages. Raises InputError as `read_log`."""
    found = layout_of(table, robot)
    if found is None:
        raise InputError(path, why_not(table, robot))
    repeated = twice(table, found[1])
    if repeated is not None:
        raise InputError(path, f"has several columns {repeated!r}; expected one: rename or remove the others")
    log = _in_si_units(_assemble(path, table, *found), found[0], robot)
    log, stamps = rebuilt(log, robot)
    point = table.values[:, found[1]["tool_point"]] if "tool_point" in found[1] else None
    log, by_speeds = _by_speeds(log, robot)
    recorded, log = log.q, _unwrapped(log, robot)
    faults = garbled_rows(log.time, log.q, robot) | table.broken
    known = np.isfinite(log.q).all(axis=1) | ~np.isfinite(log.time)  # angles of other rows were not measured
    garbled = sum(bool(known[row]) for row in faults)
    if not faults and len(log.time) < 2:
        raise InputError(path, "has one row of numbers; expected a recording of seconds")
    if garbled > FEW * len(log.time) or len(faults) > len(log.time) - 2:
        there = np.flatnonzero(np.isfinite(log.time) & np.isfinite(log.q).all(axis=1))
        require_one_clock(log.part(there, path), replace(table, lines=table.lines[there]), robot)
        raise InputError(path, refusal(table, log.q, faults, robot, recorded))
    kept = np.ones(len(log.time), bool)
    kept[list(faults)] = False
    steps = steps_of(log.q[kept])
    stale = _frozen(log, kept, steps, robot)
    kept &= ~stale.any(axis=1)
    if not kept.all():
        remarks = filter(None, [log.note, note(table, faults)])
        recorded, log = recorded[kept], replace(log.part(kept, path), note="; ".join(remarks))
        table = replace(table, lines=table.lines[kept])
        point = None if point is None else point[kept]
    require_one_clock(log, table, robot)
    order = np.unique(log.time, return_index=True)[1]
    jump = impossible_jump(log.time[order], log.q[order], robot)
    if jump is not None:
        where = f"row {table.line(order[jump[0] + 1])}"
        raise InputError(path, f"{where}: {jump[1]}; is the log damaged, in degrees, or another robot's?")
    if point is not None:
        check_tool_point(path, robot, log.q, point)
    unwrapped_q = log.q
    log, q_step = _refreshed(log, steps, robot)
    quality = MotionQuality(
        unwrapped=_names(robot, recorded != unwrapped_q),
        by_itself=_names(robot, log.q != unwrapped_q),
        frozen=_names(robot, stale),
        frozen_rows=int(stale.any(axis=1).sum()),
        rebuilt=stamps,
        by_speeds=_names(robot, by_speeds),
    )
    notes = [log.note, LEFT_OUT if table.note else ""]
    if more := more_axes(table, robot, found[0]):
        notes.append(
            f"has {robot.axes + more} axes, {robot.name} has {robot.axes}: the others are not used; is it its log?"
        )
    log = replace(log, note="; ".join(filter(None, notes)))
    return _trusted(log, robot, quality, q_step, table)


def _names(robot: RobotDescription, flags: NDArray[np.bool_]) -> tuple[str, ...]:
    """Joints with any of the flags [T, axes]."""
    return tuple(robot.joint[axis].name for axis in np.flatnonzero(flags.any(axis=0)))


def _by_speeds(log: RobotLog, robot: RobotDescription) -> tuple[RobotLog, NDArray[np.bool_]]:
    """The log with the positions that its speeds tell better than few digits, and [1, axes] which these are."""
    none = np.zeros((1, robot.axes), bool)
    if log.qd is None or len(log.time) < 2 or not np.isfinite(log.time).any():
        return log, none
    good = (np.abs(log.q) <= limits(robot)).all(axis=1) & (np.abs(log.time - np.nanmedian(log.time)) < DAY_S)
    stamps, first = np.unique(log.time[good], return_index=True)
    rows = np.flatnonzero(good)[first]
    coarse = smoothing_of(stamps, log.q[rows], steps_of(log.q[rows]), robot.speed)
    if coarse is None:
        return log, none
    angles = log.q.copy()
    angles[rows], axes = from_speeds(stamps, log.q[rows], log.qd[rows], coarse)
    return replace(log, q=angles), axes[None]


def _frozen(
    log: RobotLog, kept: NDArray[np.bool_], steps: Floats, robot: RobotDescription
) -> NDArray[np.bool_]:  # fmt: skip
    """[T, axes] angles of the rows `kept` [T], written in `steps` [axes], not refreshed while the joint moved on."""
    stale = np.zeros(log.q.shape, bool)
    rows = np.flatnonzero(kept)
    rows = rows[np.unique(log.time[rows], return_index=True)[1]]
    stale[rows] = frozen(log.time[rows], log.q[rows], steps, robot.acceleration)
    return stale


def _unwrapped(log: RobotLog, robot: RobotDescription) -> RobotLog:
    """The log without jumps of its angles by whole turns."""
    good = np.flatnonzero(np.isfinite(log.time) & np.isfinite(log.q).all(axis=1))
    rows = good[np.argsort(log.time[good], kind="stable")]
    if len(rows) < 2:
        return log
    step = np.diff(log.time[rows])
    farthest = reach(np.maximum(step, np.median(step)), robot)
    q = unwrapped(log.q[rows], farthest, np.array([not joint.slides for joint in robot.joint]))
    angles = log.q.copy()
    angles[rows] = q
    return replace(log, q=angles)


def _refreshed(log: RobotLog, steps: Floats, robot: RobotDescription) -> tuple[RobotLog, Floats]:
    """The log without the old angles of joints that are refreshed by themselves, and how finely it knows angles.

    `steps` [axes]: how finely they are written.
    """
    stamps, rows = in_time(log)
    angles = log.q.copy()
    angles[rows], q_step = between_refreshes(stamps, log.q[rows], steps, robot.speed)
    return replace(log, q=angles), q_step


def _trusted(log: RobotLog, robot: RobotDescription, found: MotionQuality, q_step: Floats, table: Table) -> RobotLog:
    """The log without rows whose pose is not that of their time, and without quantities that are not measured.

    `found`: what reading the log has shown already; `q_step` [axes]: how finely angles are known.
    Raises InputError where the times are not those of the poses at all.
    """
    stamps, rows = in_time(log)
    doubts = doubtful_rows(stamps, log.q[rows], robot.speed, q_step)
    new = np.flatnonzero(~doubts.repeated)
    fault = clock_fault(stamps[new], log.q[rows[new]], robot.speed, q_step, np.diff(new) > 1)
    if fault is not None and fault.row is not None:
        fault = replace(fault, text=f"row {table.line(int(rows[new[fault.row]]))}: {fault.text}")
    if fault is not None and fault.refused:
        raise InputError(log.path, fault.text)
    values = {name: column[rows[new]] for name in TITLES if (column := getattr(log, name)) is not None}
    judgement = judged(stamps[new], log.q[rows[new]], values, robot)
    speeds = values.get("qd") if "qd" not in judgement.unmeasured else None
    if speeds is not None and (degrees := angle_fault(stamps[new], log.q[rows[new]], speeds, robot)):
        raise InputError(log.path, degrees)
    good = ~doubts.any
    recorded = log.q[rows[good]]
    smoothing = smoothing_of(stamps[good], recorded, q_step, robot.speed)
    if smoothing:
        angles = log.q.copy()
        angles[rows[good]] = smoothed(stamps[good], recorded, smoothing.windows_s)
        log = replace(log, q=angles)
    quality = replace(
        doubts.quality(),
        unwrapped=found.unwrapped,
        by_itself=found.by_itself,
        frozen=found.frozen,
        frozen_rows=found.frozen_rows,
        zero=at_zero(log.q[rows], robot),
        unmeasured=tuple(judgement.unmeasured.values()),
        unusable=tuple(judgement.unusable.values()),
        rebuilt=found.rebuilt,
        fault=fault,
        smoothing=smoothing,
        by_speeds=found.by_speeds,
        drawn_s=drawn_every(stamps[good], recorded),
    )
    gone: dict[str, Any] = dict.fromkeys(judgement.gone)
    log = replace(log, quality=quality, **gone)
    if not quality.bad:
        return log
    kept = np.ones(len(log.time), bool)
    kept[np.isin(log.time, stamps[doubts.any])] = False
    return log.part(kept, log.path)


def _in_si_units(log: RobotLog, layout: LogColumns, robot: RobotDescription) -> RobotLog:
    length, angle = 1e-3 if layout.lengths == "mm" else 1.0, np.pi / 180 if layout.angles == "deg" else 1.0
    unit = np.array([length if joint.slides else angle for joint in robot.joint])
    if (unit == 1.0).all():
        return log
    return replace(log, q=log.q * unit, qd=None if log.qd is None else log.qd * unit)


def _assemble(path: Path, table: Table, layout: LogColumns, columns: Columns) -> RobotLog:
    def values(name: str) -> Floats | None:
        return table.values[:, columns[name]] if name in columns else None

    def single(name: str) -> Floats | None:
        return table.values[:, columns[name][0]] if name in columns else None

    clock, q = values("time"), values("q")
    assert clock is not None and q is not None
    time = _times(clock, layout)
    levels = {name: on_off(column) for name in ("tool", "brake") if (column := single(name)) is not None}
    signals = {name: column for name, column in levels.items() if column is not None}
    others_than = " and ".join(name for name, column in levels.items() if column is None)
    note = f"{others_than} holds other cells than 0 and 1, and is not used" if others_than else ""
    there = {name: column for name in PER_AXIS[1:] if (column := values(name)) is not None}
    others: dict[str, Any] = {name: column for name, column in there.items() if np.isfinite(column).any()}
    powers, voltage, current = values("power"), single("bus_voltage"), single("bus_current")
    power = None if powers is None else powers.sum(axis=1) * layout.power_unit_W
    if power is None and voltage is not None and current is not None:
        power = voltage * current
    labels = {name: table.texts(columns[name][0]) for name in LABELS if name in columns}
    return RobotLog(path, time, q, **others, signals=signals, labels=labels, power=power, voltage=voltage, note=note)


def _times(clock: Floats, layout: LogColumns) -> Floats:
    """[T] s of the columns [T, 0 to 2] of the time."""
    if not clock.shape[1]:
        return np.asarray(np.arange(len(clock)) * float(layout.row_s or 1.0))
    if clock.shape[1] == 2:
        return np.asarray(clock[:, 0] + clock[:, 1] * 1e-9)
    return np.asarray(clock[:, 0] * layout.time_unit_s)
