"""Robot descriptions: axes, limits, geometry, inertia, drives, log columns. One TOML file per robot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.robot.joint import Capsule, Drive, Friction, Joint, Link, Positive, Vector
from acqd.robot.section import Section, complaint, read_toml, read_toml_table
from acqd.section import ARRAY

__all__ = [
    "Base",
    "Capsule",
    "Drive",
    "Flange",
    "Friction",
    "Joint",
    "Link",
    "LogColumns",
    "RobotDescription",
    "Section",
    "complaint",
    "load_description",
    "read_toml",
    "read_toml_table",
    "shipped_descriptions",
]

_FOLDER = Path(__file__).parent / "descriptions"
USUAL_MASS_DEVIATION = 0.2
"""Relative deviation of a link's first moment: published sets of one robot differ by so much."""


class Base(Section):
    """The body that does not move."""

    mass: float
    """kg."""
    capsules: list[Capsule] = Field(default=[])


class Flange(Section):
    """Where tools are mounted, in the frame of the last joint."""

    xyz: Vector
    rpy_deg: Vector = (0.0, 0.0, 0.0)


class LogColumns(Section):
    """How one kind of log names its columns.

    In a name, {0} is the axis counted from 0, {1} counted from 1, {joint} the name of the joint.
    """

    format: Literal["datarecorder", "csv", "ros"]
    joints: list[str] = Field(default=[])
    """The joints' names in the order of the axes, where they differ from those of the description."""
    topic: str | None = None
    """Of ROS bags: the topic of the joint states, where several have all joints."""
    effort: Literal["tau", "current"] = "tau"
    """Of ROS bags: what the driver publishes as effort, torque in Nm or current in A."""
    header: bool = True
    columns: list[str] = Field(default=[])
    """Of a log without a header: the quantities in order. A per-axis quantity has as many columns as there are axes."""
    time: str = "time"
    time_unit_s: Positive = 1.0
    time_s: str | None = None
    """With `time_ns`: time as whole seconds and nanoseconds in two columns."""
    time_ns: str | None = None
    row_s: Positive | None = None
    """s between two rows of a log without a column of the time; its rows count from 0."""
    q: str = "q{1}"
    angles: Literal["rad", "deg"] = "rad"
    """Unit of `q`, and per second of `qd`, of the joints that turn."""
    lengths: Literal["m", "mm"] = "m"
    """Unit of `q`, and per second of `qd`, of the joints that slide."""
    qd: str | None = None
    tau: str | None = None
    current: str | None = None
    temperature: str | None = None
    tool: str | None = None
    brake: str | None = None
    power: str | list[str] | None = None
    """Electrical power, if the controller measures it; several columns, those of the drives, are added."""
    power_unit_W: Positive = 1.0
    bus_voltage: str | None = None
    """With `bus_current`: V and A at the robot's supply, whose product is the power."""
    bus_current: str | None = None
    tool_point: str | None = None
    """x, y and z of the tool's centre point in the base frame [m], three columns: they show whose log it is."""
    program: str | None = None
    """The program that runs: as the other labels a name or a number that holds until the next one."""
    step: str | None = None
    """The program's step."""
    part: str | None = None
    """The part, or the count of parts."""
    state: str | None = None
    """State of the controller, such as RTDE's runtime_state."""

    @field_validator("q", "qd", "tau", "current", "temperature", "tool_point")
    @classmethod
    def _can_be_filled(cls, pattern: str | None) -> str | None:
        try:
            (pattern or "").format(0, 1, joint="")
        except (IndexError, KeyError, ValueError, AttributeError):
            raise ValueError("expected {0}, {1} or {joint} where the names differ, and no other braces") from None
        return pattern

    @model_validator(mode="after")
    def _has_one_clock(self) -> LogColumns:
        named = self.model_fields_set & {"time", "time_unit_s", "time_s", "time_ns"}
        if self.row_s and (named or "time" in self.columns):
            named_first = min(named, default="time in columns")
            raise ValueError(f"row_s is of logs without a time; expected either row_s or {named_first}")
        return self


class RobotDescription(Section):
    """A whole robot."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    title: str
    sources: list[str]
    mass_deviation: Annotated[float, Field(gt=0, lt=1)] = Field(default=USUAL_MASS_DEVIATION)
    """Relative standard deviation of the first moment of each link."""
    drive_deviation: Annotated[float, Field(gt=0, lt=1)] = Field(default=0.1)
    """Relative standard deviation of mains power per joint torque and speed: the drives' gains and the supply's."""
    ignore_pairs: list[Annotated[tuple[int, int], ARRAY]] = Field(default=[])
    """Pairs of links (0: base) whose capsules touch by construction."""
    base: Base
    joint: Annotated[list[Joint], Field(min_length=1)]
    flange: Flange
    log: list[LogColumns] = Field(default=[])

    @model_validator(mode="after")
    def _names_differ(self) -> RobotDescription:
        names = self.joint_names
        if len(set(names)) < len(names):
            raise ValueError(f"joint names {names} are not all different")
        for layout in self.log:
            if layout.joints and len(layout.joints) != len(names):
                raise ValueError(f"log: joints names {len(layout.joints)} joints; expected {len(names)}")
        return self

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints, from base to flange."""
        return [joint.name for joint in self.joint]

    @property
    def axes(self) -> int:
        """Number of joints."""
        return len(self.joint)

    @property
    def sliding(self) -> tuple[int, ...]:
        """Numbers of the prismatic joints, from 0."""
        return tuple(k for k, joint in enumerate(self.joint) if joint.slides)

    @property
    def lower(self) -> Floats:
        """Lower position limits [axes], rad or m."""
        return np.array([joint.si(joint.limits[0]) for joint in self.joint])

    @property
    def upper(self) -> Floats:
        """Upper position limits [axes], rad or m."""
        return np.array([joint.si(joint.limits[1]) for joint in self.joint])

    @property
    def speed(self) -> Floats:
        """Speed limits [axes], rad/s or m/s."""
        return np.array([joint.si(joint.speed) for joint in self.joint])

    @property
    def acceleration(self) -> Floats:
        """Acceleration at 100 % [axes], rad/s^2 or m/s^2."""
        return np.array([joint.si(joint.acceleration) for joint in self.joint])

    @property
    def effort(self) -> Floats:
        """Greatest torques or forces [axes], Nm or N."""
        return np.array([joint.effort for joint in self.joint])


def shipped_descriptions() -> list[str]:
    """Names of the descriptions that come with acqd."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def load_description(name: str) -> RobotDescription:
    """A shipped description by name, or one from a TOML file by path. Raises UserError or InputError."""
    path = Path(name) if name.endswith(".toml") or "/" in name else _FOLDER / f"{name}.toml"
    if path.parent == _FOLDER and not path.exists():
        raise UserError(f"robot {name!r} is unknown; known: {', '.join(shipped_descriptions())}, or a path to a .toml")
    return read_toml(path, RobotDescription)
