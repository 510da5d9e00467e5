"""Joint states out of ROS 2 bags (a folder, .mcap or .db3) and ROS 1 bags (.bag)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError, UserError
from acqd.extras import install_command
from acqd.robot.bag_joints import States, arm_states
from acqd.robot.description import LogColumns, RobotDescription
from acqd.robot.table import Table

_CHUNK, _LARGEST_CHUNK = 0x06, 512 << 20
_MOST_MESSAGES = 20_000_000
"""Joint states of eleven hours at 500 Hz take 20 GB as objects."""
SUFFIXES = (".mcap", ".db3", ".bag")
_OPEN = ".bag.active"
_TYPE = "sensor_msgs/msg/JointState"
_STAMPED = 0.5
"""Share of headers with a stamp from which on the stamps count."""
_FIELDS = ("position", "velocity", "effort")
_NAMED = 5
"""Topics of other types that are listed."""


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: a file of that kind, or a folder with the metadata of a ROS 2 bag."""
    return (
        path.suffix in SUFFIXES or path.name.endswith(_OPEN) or (path.is_dir() and (path / "metadata.yaml").is_file())
    )


def read_bag(path: Path, robot: RobotDescription) -> Table:
    """The states of the robot's joints, in the order of the description, with the generic header of a log.

    Time is the stamp of the message's header, or the time of recording where the headers have no stamps. Position,
    velocity and effort (a torque or a current, as the description's layout `ros` says) become q, qd and tau or current.
    Raises InputError when no topic or more than one has all joints, UserError without the library.
    """
    if path.name.endswith(_OPEN):
        raise InputError(path, f"was not closed by its recorder: rosbag reindex {path.name}, then name it .bag")
    topics = _topics(path)
    layouts = [layout for layout in robot.log if layout.format == "ros"] or [LogColumns(format="ros")]
    layout, names, states = arm_states(path, robot, layouts, topics)
    quantities = dict(zip(_FIELDS, ("q", "qd", layout.effort), strict=True))
    columns, header = [_stamps(states)[:, None]], ["time"]
    for field, quantity in quantities.items():
        values = _values(states, field, names)
        if values is not None:
            columns.append(values)
            header += [f"{quantity}{axis + 1}" for axis in range(len(names))]
    return Table(header, np.hstack(columns), np.arange(1, len(states) + 1))


def _topics(path: Path) -> dict[str, States]:
    """Joint states of each topic. Raises InputError for a bag without them, or that is damaged."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError:
        raise UserError(f"{path}: ROS bags need rosbags: {install_command('rosbag')}") from None
    topics: dict[str, States] = {}
    others: list[str] = []
    try:
        for file in sorted(path.glob("*.mcap")) if path.is_dir() else [path]:
            _check_chunks(file)
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            if reader.message_count > _MOST_MESSAGES:
                raise ValueError(f"{reader.message_count} messages are more than are read at once; split it")
            others = sorted({f"{each.topic} ({each.msgtype})" for each in reader.connections})
            for connection, ns, state in _states(reader):
                topics.setdefault(connection.topic, []).append((ns, state))
    except Exception as error:  # whatever a damaged bag makes the library raise: struct.error, KeyError, apsw.Error ...
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(path, f"is not a readable bag ({reason:.120}){_remedy(path)}") from None
    if not topics:
        there = f", only {', '.join(others[:_NAMED])}" if others else ""
        raise InputError(
            path,
            f"has no messages of the type {_TYPE}{there}: record the topic of joint_state_broadcaster, or write a CSV "
            "file with time, q1, q2 ...",
        )
    return topics


def _check_chunks(path: Path) -> None:
    """Read the heads of the chunks of an MCAP file, not the chunks. Raises ValueError, OSError.

    A record is its kind, its length and its content; a chunk begins with two times and the size that it will have in
    memory (MCAP format specification 0).
    """
    if path.suffix != ".mcap":
        return
    with path.open("rb") as file:
        at, end = file.seek(8), path.stat().st_size
        while at + 9 <= end:
            file.seek(at)
            head = file.read(33)
            length = int.from_bytes(head[1:9], "little")
            if head[0] == _CHUNK and (size := int.from_bytes(head[25:33], "little")) > _LARGEST_CHUNK:
                raise ValueError(f"a chunk of {size / 1e6:.0f} MB is larger than what is read at once")
            at += 9 + length


def _remedy(path: Path) -> str:
    """What mends a bag whose recorder was stopped before it could close the file."""
    suffixes = {path.suffix, *(part.suffix for part in (path.iterdir() if path.is_dir() else ()))}
    if ".mcap" in suffixes:
        return "; if the recorder was stopped hard: mcap recover BROKEN.mcap -o WHOLE.mcap"
    if ".bag" in suffixes:
        return "; if the recorder was stopped hard: rosbag reindex BROKEN.bag"
    return "; if metadata.yaml is missing: ros2 bag reindex FOLDER" if ".db3" in suffixes else ""


def _states(reader: Any) -> Iterator[tuple[Any, int, Any]]:
    wanted = [connection for connection in reader.connections if connection.msgtype == _TYPE]
    if wanted:  # without any, the library would read all topics
        for connection, ns, raw in reader.messages(connections=wanted):
            yield connection, ns, reader.deserialize(raw, connection.msgtype)


def _stamps(states: States) -> Floats:
    """[T] s of the headers, or of the recording where hardly a header has any, or all have the same.

    A few headers without a stamp are those of a driver that starts: their rows take the time of recording, as much
    earlier as the other rows are stamped earlier.
    """
    stamps = np.array([state.header.stamp.sec + state.header.stamp.nanosec * 1e-9 for _, state in states])
    recorded = np.array([ns * 1e-9 for ns, _ in states])
    stamped = stamps > 0.0
    if stamped.mean() < _STAMPED or (len(stamps) > 1 and np.ptp(stamps) == 0.0):
        return recorded
    earlier_s = float(np.median((recorded - stamps)[stamped]))
    return np.asarray(np.where(stamped, stamps, recorded - earlier_s))


def _values(states: States, field: str, names: list[str]) -> Floats | None:
    """[T, joints] of one field; None unless every message has it for all of its joints."""
    rows = []
    order: dict[tuple[str, ...], list[int]] = {}
    for _, state in states:
        values, present = getattr(state, field), tuple(state.name)
        if len(values) != len(present):
            return None
        if present not in order:
            order[present] = [present.index(name) for name in names]
        rows.append(np.asarray(values)[order[present]])
    return np.array(rows, dtype=np.float64)
