"""Robot logs."""

from __future__ import annotations

from acqd.api.doubts import warn_of
from acqd.api.places import Place, path_of
from acqd.api.robot import Robot
from acqd.robot.log import RobotLog
from acqd.robot.log_reader import read_log as read

__all__ = ["RobotLog", "read_log"]


def read_log(path: Place, robot: Robot | Place) -> RobotLog:
    """Read a robot's log: DataRecorder text, CSV, Parquet or a ROS bag, with the columns that `robot` names.

    Warns of rows that are left out, and of columns that say nothing. Raises InputError that names row and column,
    UserError without the library that a format needs.

    >>> log = read_log("logs/example.csv", "ur10e")
    >>> log.q.shape
    (700, 6)
    """
    known = robot if isinstance(robot, Robot) else Robot(robot)
    log = read(path_of(path), known.description)
    warn_of([line for line in (log.note, *log.quality.sentences()) if line])
    return log
