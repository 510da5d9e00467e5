"""Robot logs: joint angles over the controller's clock, and whatever else the controller recorded."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.robot.bag import is_bag, read_bag
from acqd.robot.columns import angle_fault, speed_fault, stuck, temperature_fault
from acqd.robot.description import LogColumns, RobotDescription
from acqd.robot.doubtful_rows import doubtful_rows
from acqd.robot.garbled import BEYOND, FEW, beyond_limit, clock_restart, garbled_rows, impossible_jump, limits, reach
from acqd.robot.joint_refresh import between_refreshes, frozen
from acqd.robot.labels import Texts
from acqd.robot.last_line import LEFT_OUT
from acqd.robot.log_layout import LABELS, PER_AXIS, Columns, layout_of, more_axes, twice, why_not, word_columns
from acqd.robot.motion_quality import MotionQuality
from acqd.robot.resolution import smoothed, smoothing_of, steps_of
from acqd.robot.row_clock import LateStamps, clock_fault, late_stamps, set_back
from acqd.robot.table import Table, read_table
from acqd.robot.tool_point import check_tool_point
from acqd.robot.unwrapping import unwrapped
from acqd.rounded_times import Rebuilt, rebuilt_times, shared_stamps

LATEST_S = 7_258_118_400.0
"""2200-01-01 in Unix seconds."""
_MS = 1e14
"""Unix time in ms is below, in us below a thousand times that."""
_WHOLE_S = 100.0
"""From which on tenths of a second are digits enough."""
_DAY_S = 86_400.0
_NO_TIMES = 0.9
"""Share of rows without a time beyond which times are of another form."""
_NAMED_ROWS = 5
_MOVED = 0.05
"""rad or m that a joint covers at least in a log in which its speed, torque and current cannot stay zero."""
_FEW_SHARED = 0.25
"""Share of rows up to which rows of one stamp can be spared."""
_TITLES = {"qd": "speed", "tau": "torque", "current": "current", "temperature": "temperature"}


@dataclass(frozen=True, slots=True)
class RobotLog:
    """One recording with the rows of the file: not resampled, not sorted; a few garbled rows may be left out."""

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
    labels: dict[str, Texts] = field(default_factory=dict)
    """`program`, `step`, `part` and `state` [T], where recorded."""
    power: Floats | None = None
    """[T] W, measured by the controller: the logged power, or voltage times current of the supply."""
    voltage: Floats | None = None
    """[T] V at the robot's supply, where the controller measures it."""
    core: tuple[float, float] | None = None
    """Of a piece of a log: the span [s] that is the piece; rows outside it tell how the arm came and went."""
    note: str = ""
    """Which garbled rows were left out, and why; empty if none."""
    quality: MotionQuality = field(default=MotionQuality())
    """What was found in the motion, and left out or mended."""

    def part(self, rows: NDArray[np.bool_] | NDArray[np.int64], path: Path) -> RobotLog:
        """Some rows as a log of the name `path`."""
        names = ("time", "q", "qd", "tau", "current", "temperature", "power", "voltage")
        values: dict[str, Any] = {
            name: None if (column := getattr(self, name)) is None else column[rows] for name in names
        }
        signals = {name: column[rows] for name, column in self.signals.items()}
        labels = {name: column[rows] for name, column in self.labels.items()}
        return replace(self, path=path, signals=signals, labels=labels, **values)


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
    log = _assemble(path, table, *found)
    usual = float(np.median(log.time))  # single stamps may be garbled
    if usual > LATEST_S:
        unit = "ms" if usual < _MS else "us" if usual < 1e3 * _MS else "ns"
        raise InputError(path, f"its times are about {usual:.4g} s; expected seconds before 2200: are they in {unit}?")
    log, stamps = _with_even_times(*_with_distinct_times(log), robot)
    point = table.values[:, found[1]["tool_point"]] if "tool_point" in found[1] else None
    recorded, log = log.q, _unwrapped(log, robot)
    faults = garbled_rows(log.time, log.q, robot) | table.broken
    known = np.isfinite(log.q).all(axis=1) | ~np.isfinite(log.time)  # angles of other rows were not measured
    garbled = sum(bool(known[row]) for row in faults)
    if garbled > FEW * len(log.time) or len(faults) > len(log.time) - 2:
        raise InputError(path, _refusal(table, log.q, faults, robot))
    kept = np.ones(len(log.time), bool)
    kept[list(faults)] = False
    stale = _frozen(log, kept, robot)
    kept &= ~stale.any(axis=1)
    if not kept.all():
        recorded, log = recorded[kept], replace(log.part(kept, path), note=_note(table, faults))
        table = replace(table, lines=table.lines[kept])
        point = None if point is None else point[kept]
    _require_one_clock(log, table, robot)
    order = np.unique(log.time, return_index=True)[1]
    order = order[np.concatenate([[True], (np.diff(log.q[order], axis=0) != 0).any(axis=1)])]  # poses may be held
    jump = impossible_jump(log.time[order], log.q[order], robot)
    if jump is not None:
        where = f"row {table.line(order[jump[0] + 1])}"
        raise InputError(path, f"{where}: {jump[1]}; is the log damaged, in degrees, or another robot's?")
    if point is not None:
        check_tool_point(path, robot, log.q, point)
    unwrapped_q = log.q
    log, q_step = _refreshed(log, robot)
    quality = MotionQuality(
        unwrapped=_names(robot, recorded != unwrapped_q),
        by_itself=_names(robot, log.q != unwrapped_q),
        frozen=_names(robot, stale),
        frozen_rows=int(stale.any(axis=1).sum()),
        rebuilt=stamps,
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


def _frozen(log: RobotLog, kept: NDArray[np.bool_], robot: RobotDescription) -> NDArray[np.bool_]:
    """[T, axes] angles of the rows `kept` [T] that were not refreshed while the joint moved on."""
    stale = np.zeros(log.q.shape, bool)
    rows = np.flatnonzero(kept)
    rows = rows[np.unique(log.time[rows], return_index=True)[1]]
    stale[rows] = frozen(log.time[rows], log.q[rows], steps_of(log.q[rows]), robot.acceleration)
    return stale


def _require_one_clock(log: RobotLog, table: Table, robot: RobotDescription) -> None:
    """Raises InputError where the clock was set back in a log, or its times begin again."""
    back = set_back(log.time, log.q, robot.speed)
    if back is not None:
        by = log.time[back - 1] - log.time[back]
        back_s = f"{by:.1f}" if by > _WHOLE_S else f"{by:.3g}"
        raise InputError(
            log.path,
            f"row {table.line(back)}: the time goes back by {back_s} s while the arm moves on: the clock was set there "
            "(the end of summer time, say); cut the log at this row, or write UTC",
        )
    restart = clock_restart(log.time, log.q)
    if restart is not None:
        again = f"time goes back from {log.time[restart - 1]:.3f} to {log.time[restart]:.3f} s"
        raise InputError(
            log.path, f"row {table.line(restart)}: {again} with other angles: write one file per recording"
        )


def _with_distinct_times(log: RobotLog) -> tuple[RobotLog, Rebuilt | None]:
    """The log with the times of rows that share a stamp put at their distances, and how.

    Raises InputError where the rate of such rows is not regular.
    """
    if not np.isfinite(log.time).all():
        return log, None
    origin = float(np.median(log.time))  # the first time may be garbled
    since = log.time - origin
    shared = shared_stamps(since, (log.q[1:] != log.q[:-1]).any(axis=1))
    if not shared:
        return log, None
    rebuilt = rebuilt_times(since, shared)
    few = shared < _FEW_SHARED * len(since)
    if few and (rebuilt is None or rebuilt.stamp_s == 0.0):
        return log, None  # digits about as wide as the rows: one row of each stamp is used, and its time is doubted
    if rebuilt is None:
        raise InputError(
            log.path,
            f"{shared} of {len(since)} rows have the time of the row before with other angles, and their rate is not "
            "regular: are times written with too few digits? Expected times with three decimals or more",
        )
    return replace(log, time=origin + rebuilt.time), rebuilt


def _with_even_times(
    log: RobotLog, rebuilt: Rebuilt | None, robot: RobotDescription
) -> tuple[RobotLog, Rebuilt | LateStamps | None]:
    """The log with the times of the controller's rate where the stamps are those of a recorder, and how."""
    good = np.flatnonzero(np.isfinite(log.time) & np.isfinite(log.q).all(axis=1))
    if rebuilt is not None or len(good) < 2:
        return log, rebuilt
    rows = good[np.unique(log.time[good], return_index=True)[1]]
    if not (np.diff(rows) > 0).all():  # rows that are not in order tell nothing of who stamped them
        return log, None
    origin = float(np.median(log.time[good]))
    late = late_stamps(log.time[rows] - origin, log.q[rows], robot.speed, steps_of(log.q[rows]))
    if late is None:
        return log, None
    time = log.time.copy()
    time[rows] = origin + late.time
    return replace(log, time=time), late


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


def _refreshed(log: RobotLog, robot: RobotDescription) -> tuple[RobotLog, Floats]:
    """The log without the old angles of joints that are refreshed by themselves, and how finely it knows angles."""
    stamps, rows = in_time(log)
    angles = log.q.copy()
    angles[rows], q_step = between_refreshes(stamps, log.q[rows], steps_of(log.q[rows]), robot.speed)
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
    moves = np.ptp(log.q, axis=0) > _MOVED
    known = {name: values for name in _TITLES if (values := getattr(log, name)) is not None and len(values)}
    constant = {name: axes for name, values in known.items() if (axes := stuck(name, values, moves)).any()}
    unmeasured = tuple(
        f"the {_TITLES[name]} of {'every joint' if axes.all() else robot.joint[int(axes.argmax())].name}"
        for name, axes in constant.items()
    )
    unusable = {}
    if log.qd is not None and "qd" not in constant:
        if degrees := angle_fault(stamps[new], log.q[rows[new]], log.qd[rows[new]], robot):
            raise InputError(log.path, degrees)
        unusable["qd"] = speed_fault(stamps[new], log.q[rows[new]], log.qd[rows[new]], robot)
    if log.temperature is not None and "temperature" not in constant:
        unusable["temperature"] = temperature_fault(log.temperature)
    unusable = {name: fault for name, fault in unusable.items() if fault}
    good = ~doubts.any
    smoothing = smoothing_of(stamps[good], log.q[rows[good]], q_step, robot.speed)
    if smoothing:
        angles = log.q.copy()
        angles[rows[good]] = smoothed(stamps[good], log.q[rows[good]], smoothing.windows_s)
        log = replace(log, q=angles)
    quality = replace(
        doubts.quality(),
        unwrapped=found.unwrapped,
        by_itself=found.by_itself,
        frozen=found.frozen,
        frozen_rows=found.frozen_rows,
        unmeasured=unmeasured,
        unusable=tuple(unusable.values()),
        rebuilt=found.rebuilt,
        fault=fault,
        smoothing=smoothing,
    )
    gone: dict[str, Any] = dict.fromkeys([*constant, *unusable])
    log = replace(log, quality=quality, **gone)
    if not quality.bad:
        return log
    kept = np.ones(len(log.time), bool)
    kept[np.isin(log.time, stamps[doubts.any])] = False
    return log.part(kept, log.path)


def _assemble(path: Path, table: Table, layout: LogColumns, columns: Columns) -> RobotLog:
    def values(name: str) -> Floats | None:
        return table.values[:, columns[name]] if name in columns else None

    def single(name: str) -> Floats | None:
        return table.values[:, columns[name][0]] if name in columns else None

    clock, q = values("time"), values("q")
    assert clock is not None and q is not None
    time = clock[:, 0] + clock[:, 1] * 1e-9 if clock.shape[1] == 2 else clock[:, 0] * layout.time_unit_s
    signals = {name: column for name in ("tool", "brake") if (column := single(name)) is not None}
    there = {name: column for name in PER_AXIS[1:] if (column := values(name)) is not None}
    others: dict[str, Any] = {name: column for name, column in there.items() if np.isfinite(column).any()}
    power, voltage, current = single("power"), single("bus_voltage"), single("bus_current")
    if power is None and voltage is not None and current is not None:
        power = voltage * current
    labels = {name: table.texts(columns[name][0]) for name in LABELS if name in columns}
    return RobotLog(path, time, q, **others, signals=signals, labels=labels, power=power, voltage=voltage)


def _refusal(table: Table, q: Floats, faults: dict[int, str], robot: RobotDescription) -> str:
    """Why a log with many garbled rows is refused: degrees, another robot, or damage."""
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
    if BEYOND not in text or not len(beyond):
        return f"row {table.line(row)}: {text}{share}"
    text = beyond_limit(robot, int(beyond[0]), float(worst[beyond[0]]))
    if (np.radians(worst) <= limits(robot)).all() and worst.max() > 20:
        return f"{text}; the angles look like degrees: write radians"
    return f"{text}; is this a log of {robot.name}?"


def _note(table: Table, faults: dict[int, str]) -> str:
    if not faults:
        return ""
    rows = sorted(faults)
    named = ", ".join(str(table.line(row)) for row in rows[:_NAMED_ROWS])
    more = f" and {len(rows) - _NAMED_ROWS} more" if len(rows) > _NAMED_ROWS else ""
    word = "row" if len(rows) == 1 else "rows"
    return f"{len(rows)} of {len(table.lines)} rows garbled and left out: {word} {named}{more} ({faults[rows[0]]})"


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
