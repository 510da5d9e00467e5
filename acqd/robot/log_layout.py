"""Which column of a robot's log holds which quantity: the layouts of a description, or the generic header."""

from __future__ import annotations

import re

from acqd.robot.description import LogColumns, RobotDescription
from acqd.robot.table import Table

PER_AXIS = ("q", "qd", "tau", "current", "temperature")
"""Quantities with one column for each axis."""
LABELS = ("program", "step", "part", "state")
"""Numbers that say what the robot is working on."""
_SINGLE = ("tool", "brake", "power", "bus_voltage", "bus_current", *LABELS)
_GENERIC = LogColumns(
    format="csv",
    q="q{1}",
    qd="qd{1}",
    tau="tau{1}",
    current="current{1}",
    temperature="temperature{1}",
    tool="tool",
    brake="brake",
    power="power",
    bus_voltage="bus_voltage",
    bus_current="bus_current",
    tool_point="tcp{1}",
    program="program",
    step="step",
    part="part",
    state="state",
)
"""The generic header: time, q1.., qd1.., tau1.., current1.., temperature1.., tool, brake, power, tcp1 .., labels."""

_TELLING = 3
"""Letters of a joint's name that is no part of other words."""
Columns = dict[str, list[int]]


def layout_of(table: Table, robot: RobotDescription) -> tuple[LogColumns, Columns] | None:
    """The first layout that fits a table, with the column numbers of each quantity; None when none fits."""
    for layout in [*robot.log, _GENERIC]:
        columns = _match(layout, table, robot)
        if columns is not None:
            return layout, columns
    return None


def _match(layout: LogColumns, table: Table, robot: RobotDescription) -> Columns | None:
    """Column numbers per quantity, or None when this layout is not the file's."""
    if layout.format == "ros":
        return None
    if not layout.header:
        return _in_order(layout, table, robot.axes) if table.header is None else None
    if table.header is None:
        return None
    where = {name: number for number, name in enumerate(table.header)}
    # the reader takes these marks for those of a comment, a user for a part of the name
    where = {mark + table.header[0]: 0 for mark in "%#"} | where
    joints = layout.joints or robot.joint_names
    columns: Columns = {}
    for name in PER_AXIS:
        pattern = getattr(layout, name)
        names = [pattern.format(axis, axis + 1, joint=joint) for axis, joint in enumerate(joints)] if pattern else []
        if names and all(column in where for column in names):
            columns[name] = [where[column] for column in names]
    clock = clock_of(layout)
    if "q" not in columns or not all(name in where for name in clock):
        return None
    columns["time"] = [where[name] for name in clock]
    point = [layout.tool_point.format(axis, axis + 1) for axis in range(3)] if layout.tool_point else []
    if point and all(name in where for name in point):
        columns["tool_point"] = [where[name] for name in point]
    for name in _SINGLE:
        column = getattr(layout, name)
        names = column if isinstance(column, list) else [column]
        if names and all(each in where for each in names):
            columns[name] = [where[each] for each in names]
    return columns


def clock_of(layout: LogColumns) -> list[str]:
    """Columns of the time: one in a unit, or whole seconds and nanoseconds; none where rows are evenly apart."""
    if layout.row_s:
        return []
    return [layout.time_s, layout.time_ns] if layout.time_s and layout.time_ns else [layout.time]


def _in_order(layout: LogColumns, table: Table, axes: int) -> Columns | None:
    columns: Columns = {"time": []} if layout.row_s else {}
    at = 0
    for name in layout.columns:
        count = 1 if name == "time" or name in _SINGLE else axes
        columns[name] = list(range(at, at + count))
        at += count
    return columns if at == table.values.shape[1] else None


def word_columns(robot: RobotDescription) -> set[str]:
    """Names of the columns that may hold words: labels, in all layouts of `robot`."""
    return {name for layout in [*robot.log, _GENERIC] for label in LABELS if (name := getattr(layout, label))}


def _clocks(layouts: list[LogColumns]) -> str:
    """Names of the time columns of some layouts."""
    return " or ".join(dict.fromkeys(" and ".join(clock) for each in layouts if (clock := clock_of(each))))


def twice(table: Table, columns: Columns) -> str | None:
    """A name of the layout that more than one column has: nobody knows which of them is meant."""
    header = table.header or []
    used = [header[number] for numbers in columns.values() for number in numbers if number < len(header)]
    return next((name for name in used if header.count(name) > 1), None)


def more_axes(table: Table, robot: RobotDescription, layout: LogColumns) -> int:
    """Axes of the table beyond those of `robot`."""
    if table.header is None or not layout.q:
        return 0
    names = set(table.header)
    count = 0
    while layout.q.format(robot.axes + count, robot.axes + count + 1, joint="") in names:
        count += 1
    return count


def _is_fraction(cell: str) -> bool:
    """A number that nobody would call a column: 1 may be a name, 0.25 is not."""
    return re.fullmatch(r"[+-]?\d*\.\d+(?:[eE][+-]?\d+)?", cell) is not None


def _generic_names(robot: RobotDescription) -> str:
    """Names of the columns of the generic header."""
    return "time,q1" if robot.axes == 1 else f"time,q1..q{robot.axes}"


def _other_form(header: list[str], robot: RobotDescription) -> str:
    """What a header that no log of `robot` has shows the table to be; else empty."""
    if sum(_is_fraction(name) for name in header) > robot.axes:
        return f"holds numbers in its first line; expected a header {_generic_names(robot)} before them"
    if {"value", "_value"} & {name.lower() for name in header}:
        return (
            f"has one value in each row; expected a row for each time with columns {_generic_names(robot)}: pivot the "
            "table first"
        )
    return ""


def _named_otherwise(header: list[str], robot: RobotDescription) -> str:
    """What to do with a header that has the generic names in other letters, or the names of the joints; else empty."""
    plain = [re.sub(r"[\[(].*?[\])]|[^a-z0-9]", "", name.lower()) for name in header]
    if {"time", *(f"q{axis + 1}" for axis in range(robot.axes))} <= set(plain):
        return (
            f"names its columns otherwise: expected time, q1 .. q{robot.axes} (s, rad) in small letters, without "
            "units, blanks or underscores"
        )
    own = robot.joint_names
    known = [layout.joints for layout in robot.log if layout.joints] + [own]
    joints = next((each for each in known if all(any(joint in name for name in header) for joint in each)), None)
    if joints is None or min(map(len, joints)) < _TELLING:
        return ""
    names = "" if joints == own else " and joints = [" + ", ".join(f'"{joint}"' for joint in joints) + "]"
    return (
        'names its columns by the joints; add to the robot\'s description a section [[log]] with format = "csv", '
        f'the column of the time and q = "..." as they are, but with {{joint}} for the name of the joint{names}'
    )


def why_not(table: Table, robot: RobotDescription) -> str:
    """Why no layout of `robot` fits the table: a sentence for the user that quotes nothing of the file.

    The sidecar publishes this sentence, and a file in its folder may be of anybody.
    """
    if table.header is None:
        return f"has no header and {table.values.shape[1]} columns; expected a header {_generic_names(robot)}"
    if form := _other_form(table.header, robot):
        return form
    numbered: dict[str, set[int]] = {}
    for name in table.header:
        digits = re.fullmatch(r"(.*?)(\d{1,6})(\D*)", name)
        if digits:
            numbered.setdefault(digits[1] + "#" + digits[3], set()).add(int(digits[2]))
    layouts = [layout for layout in [*robot.log, _GENERIC] if layout.header and layout.format != "ros"]
    patterns = [layout.q.format("#", "#", joint="#") for layout in layouts]
    for pattern in patterns:
        count = len(numbered.get(pattern, ()))
        if count and count != robot.axes:
            return f"has {count} columns {pattern.replace('#', 'N')}, but {robot.name} has {robot.axes} axes"
        counted = numbered.get(pattern, set())
        if count and counted == set(range(robot.axes)) and pattern == layouts[-1].q.format("#", "#", joint="#"):
            return f"counts its axes from 0: expected {pattern.replace('#', '1')} .. {pattern.replace('#', str(count))}"
        if count:  # all angles are there, so that the time is not
            other = any(name.lower().startswith(("time", "t_", "t [", "t(", "stamp")) for name in table.header)
            remedy = "; rename the column of the time, and write it in s" if other else ""
            return f"has {count} columns {pattern.replace('#', 'N')}, but no time: expected {_clocks(layouts)}{remedy}"
    if remedy := _named_otherwise(table.header, robot):
        return remedy
    expected = " or ".join([_generic_names(robot), *patterns[:-1]])
    own = next((count for numbers in numbered.values() if (count := len(numbers)) == robot.axes), 0)
    which = (
        "the numbered column of its first line is the angle"
        if own == 1
        else f"{own} numbered columns of its first line are the angles"
    )
    named = f"; if {which}, " if own else "; otherwise "
    return (
        f"has none of the columns a log of {robot.name} has ({expected}){named}name them in a section [[log]] of the "
        'robot\'s description, as q = "joint_{1}", with angles = "deg" for degrees'
    )
