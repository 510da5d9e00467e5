"""Robot descriptions: axes, limits, geometry, inertia, drives, log columns. One TOML file per robot."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from acqd.arrays import Floats
from acqd.errors import InputError, UserError

_FOLDER = Path(__file__).parent / "descriptions"
_Vector = tuple[float, float, float]
_Positive = Annotated[float, Field(gt=0)]
Model = TypeVar("Model", bound=BaseModel)


class Section(BaseModel):
    """A table of a TOML file: unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True, populate_by_name=True)


class Capsule(Section):
    """A cylinder with round ends, in the frame of its link."""

    radius: _Positive
    """m."""
    start: Annotated[_Vector, Field(alias="from")]
    """m."""
    end: Annotated[_Vector, Field(alias="to")]
    """m."""


class Link(Section):
    """Inertial parameters of the body that a joint moves."""

    mass: _Positive
    """kg."""
    com: _Vector
    """Centre of mass in the link frame [m]."""
    inertia: tuple[float, float, float, float, float, float]
    """xx, yy, zz, xy, xz, yz at the centre of mass [kg m^2]."""
    inertia_rpy_deg: _Vector = (0.0, 0.0, 0.0)
    """Orientation of the axes of `inertia` in the link frame."""


class Drive(Section):
    """Motor and gear, as far as they are known."""

    gear_ratio: _Positive
    rotor_inertia_kgm2: Annotated[float, Field(ge=0)]
    """Rotor inertia reflected to the gear's output."""
    torque_constant_Nm_A: _Positive
    """Torque constant of the motor, before the gear."""
    resistance_Ohm: _Positive
    """Effective resistance: R i^2 is the whole copper loss."""


class Joint(Section):
    """A revolute joint and its link. `xyz` and `rpy_deg` (URDF) place its frame in the frame of the joint before."""

    name: str
    xyz: _Vector
    """m."""
    rpy_deg: _Vector = (0.0, 0.0, 0.0)
    axis: _Vector
    limits_deg: tuple[float, float]
    speed_deg_s: _Positive
    acceleration_deg_s2: _Positive
    """Acceleration at 100 %."""
    torque_Nm: _Positive
    drive: Drive
    link: Link
    capsules: list[Capsule] = []

    @field_validator("limits_deg")
    @classmethod
    def _ordered(cls, limits: tuple[float, float]) -> tuple[float, float]:
        if not limits[0] < limits[1]:
            raise ValueError("expected [lower, upper]")
        return limits


class Base(Section):
    """The body that does not move."""

    mass: float
    """kg."""
    capsules: list[Capsule] = []


class Flange(Section):
    """Where tools are mounted, in the frame of the last joint."""

    xyz: _Vector
    rpy_deg: _Vector = (0.0, 0.0, 0.0)


class LogColumns(Section):
    """How one kind of log names its columns. In a name, {0} is the axis counted from 0, {1} counted from 1."""

    format: Literal["datarecorder", "csv", "ros"]
    joints: list[str] = []
    """Of ROS bags: the joints' names in the order of the axes, where they differ from those of the description."""
    effort: Literal["tau", "current"] = "tau"
    """Of ROS bags: what the driver publishes as effort, torque in Nm or current in A."""
    header: bool = True
    columns: list[str] = []
    """Of a log without a header: the quantities in order. A per-axis quantity has as many columns as there are axes."""
    time: str = "time"
    time_unit_s: _Positive = 1.0
    time_s: str | None = None
    """With `time_ns`: time as whole seconds and nanoseconds in two columns."""
    time_ns: str | None = None
    q: str = "q{1}"
    qd: str | None = None
    tau: str | None = None
    current: str | None = None
    temperature: str | None = None
    tool: str | None = None
    brake: str | None = None
    power: str | None = None
    """Electrical power in W, if the controller measures it."""
    bus_voltage: str | None = None
    """With `bus_current`: V and A at the robot's supply, whose product is the power."""
    bus_current: str | None = None


class RobotDescription(Section):
    """A whole robot."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    title: str
    sources: list[str]
    ignore_pairs: list[tuple[int, int]] = []
    """Pairs of links (0: base) whose capsules touch by construction."""
    base: Base
    joint: Annotated[list[Joint], Field(min_length=1)]
    flange: Flange
    log: list[LogColumns] = []

    @model_validator(mode="after")
    def _names_differ(self) -> RobotDescription:
        names = [joint.name for joint in self.joint]
        if len(set(names)) < len(names):
            raise ValueError(f"joint names {names} are not all different")
        return self

    @property
    def axes(self) -> int:
        """Number of joints."""
        return len(self.joint)

    @property
    def lower(self) -> Floats:
        """Lower position limits [axes], rad."""
        return np.radians([joint.limits_deg[0] for joint in self.joint])

    @property
    def upper(self) -> Floats:
        """Upper position limits [axes], rad."""
        return np.radians([joint.limits_deg[1] for joint in self.joint])

    @property
    def speed(self) -> Floats:
        """Speed limits [axes], rad/s."""
        return np.radians([joint.speed_deg_s for joint in self.joint])

    @property
    def acceleration(self) -> Floats:
        """Acceleration at 100 % [axes], rad/s^2."""
        return np.radians([joint.acceleration_deg_s2 for joint in self.joint])


def shipped_descriptions() -> list[str]:
    """Names of the descriptions that come with acqd."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def load_description(name: str) -> RobotDescription:
    """A shipped description by name, or one from a TOML file by path. Raises UserError or InputError."""
    path = Path(name) if name.endswith(".toml") or "/" in name else _FOLDER / f"{name}.toml"
    if path.parent == _FOLDER and not path.exists():
        raise UserError(f"robot {name!r} is unknown; known: {', '.join(shipped_descriptions())}, or a path to a .toml")
    return read_toml(path, RobotDescription)


def read_toml(path: Path, model: type[Model]) -> Model:
    """A validated TOML file. Raises InputError that names file and key."""
    try:
        return model.model_validate(read_toml_table(path))
    except ValidationError as error:
        raise InputError(path, "; ".join(complaint(fault) for fault in error.errors())) from None


def read_toml_table(path: Path) -> dict[str, Any]:
    """The raw content of a TOML file. Raises InputError."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "no UTF-8 text"
        raise InputError(path, f"cannot be read ({reason})") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, f"is not valid TOML: {error}") from None


def complaint(fault: object) -> str:
    """One pydantic error as `key: what is wrong (got ...)`."""
    assert isinstance(fault, dict)
    key = ".".join(str(part) for part in fault["loc"]) or "the file"
    if fault["type"] == "extra_forbidden":
        return f"{key}: there is no such key; is it misspelt, or in the wrong table?"
    if fault["type"] == "missing":
        return f"{key} is missing"
    return f"{key}: {fault['msg'].removeprefix('Value error, ')} (got {fault['input']!r:.60})"
