"""Settings of the laboratory: the keys of `lab.toml`, with the defaults of the thesis."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from acqd.lab.effects import EffectSpec
from acqd.lab.instruments.data_recorder import ControllerClock, RecorderSettings
from acqd.lab.instruments.mains import MainsSettings
from acqd.motion.excitation import Cube
from acqd.motion.program import MotionParameters
from acqd.robot.description import Section
from acqd.robot.joint import Vector
from acqd.section import ARRAY, FileName

_Share = Annotated[float, Field(ge=0, le=1)]


class MotionSection(Section):
    """Ranges of the random parameters of each motion (thesis, Listing 5.1)."""

    relative_speed: Annotated[tuple[_Share, _Share], ARRAY] = (0.2, 0.5)
    relative_blending: Annotated[tuple[_Share, _Share], ARRAY] = (0.0, 0.5)
    relative_acceleration: Annotated[float, Field(ge=0.01, le=1)] = 0.2

    @field_validator("relative_speed", "relative_blending")
    @classmethod
    def _ordered(cls, limits: tuple[float, float]) -> tuple[float, float]:
        if limits[0] > limits[1]:
            raise ValueError("expected [lowest, highest]")
        return limits

    @field_validator("relative_speed")
    @classmethod
    def _moves(cls, limits: tuple[float, float]) -> tuple[float, float]:
        if limits[0] < 0.01:
            raise ValueError("must be at least 0.01")
        return limits

    def parameters(self) -> MotionParameters:
        """The parameters in the planner's type."""
        return MotionParameters(**self.model_dump())


class CubeSection(Section):
    """The cube of the limited space (thesis, Algorithm 1); lengths in m."""

    centre: Vector = (0.6, 0.0, 0.34)
    edge: Annotated[float, Field(ge=0.01, le=3)] = 0.3

    def cube(self) -> Cube:
        """The cube in the generator's type."""
        return Cube(self.centre, self.edge)


class ClockSection(Section):
    """The robot controller's clock, which is not synchronised."""

    offset_s: Annotated[float, Field(ge=-1e9, le=1e9)] = 1.24
    """Controller minus UTC at the start of the campaign."""
    drift_ppm: Annotated[float, Field(ge=-1000, le=1000)] = 8.0

    def clock(self, origin_utc_ns: int) -> ControllerClock:
        """The clock in the recorder's type."""
        return ControllerClock(self.offset_s, self.drift_ppm, origin_utc_ns)


class RecorderSection(Section):
    """The robot controller's DataRecorder (thesis, Listing 4.1)."""

    period_s: Annotated[float, Field(ge=0.001, le=1)] = 0.04
    timeout_s: Annotated[float, Field(ge=1, le=100_000)] = 400.0
    jitter_s: Annotated[float, Field(ge=0, le=0.1)] = 0.0005
    missing: Annotated[float, Field(ge=0, le=0.9)] = 0.0
    angle_noise_rad: Annotated[float, Field(ge=0, le=0.1)] = 2e-6
    torque_noise_Nm: Annotated[float, Field(ge=0, le=100)] = 0.15
    torque_scale: Annotated[float, Field(ge=0.5, le=2)] = 1.0
    signals: bool = True

    def settings(self) -> RecorderSettings:
        """The settings in the recorder's type."""
        return RecorderSettings(**self.model_dump())


class LabSettings(Section):
    """A virtual cell and its effects."""

    robot: str = "iiwa7_r800"
    """Shipped name, or path of a description."""
    scene: str | None = None
    """Shipped name or path; None: `digital_factory` for the iiwa, `free` for others."""
    plant: FileName | None = None
    """Plant file; None: the one shipped for the robot."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    robot_seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    """Of the true robot's deviations from its description: which robot is measured. None: `seed`."""
    start: datetime = datetime(2021, 7, 13, 8, 0, tzinfo=UTC)
    """UTC of the start of the campaign."""
    device: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$")] = "cell"
    window: Annotated[float, Field(ge=0.04, le=0.05)] | None = None
    """s, whole milliseconds; None: 40 ms at 50 Hz, 50 ms at 60 Hz, as in the daemon."""
    start_degC: Annotated[float, Field(ge=-20, le=80)] | None = None
    """Gear temperature at the start of each session; None: 30 degC, warm from work."""
    worked_min: Annotated[float, Field(ge=0, le=1e5)] = 0.0
    """Minutes that the robot has worked before each session; effects of cold gears have decayed by that time."""
    pause_s: Annotated[float, Field(ge=0.5, le=3600)] = 12.0
    """Between executions; the brakes close after 10 s."""
    motion: MotionSection = MotionSection()
    cube: CubeSection | None = None
    """None: the cube of the thesis for the iiwa, a reachable cube for other shipped robots."""
    mains: MainsSettings = MainsSettings()
    recorder: RecorderSection = RecorderSection()
    clock: ClockSection = ClockSection()
    effects: list[EffectSpec] = Field(default=[])

    @field_validator("start")
    @classmethod
    def _zoned(cls, start: datetime) -> datetime:
        start = start if start.tzinfo else start.replace(tzinfo=UTC)
        if not 1971 <= start.year < 2200:
            raise ValueError("expected a time between 1971 and 2199")
        return start

    @field_validator("window")
    @classmethod
    def _whole_milliseconds(cls, window: float | None) -> float | None:
        if window is not None and abs(window * 1000 - round(window * 1000)) > 1e-9:
            raise ValueError("expected whole milliseconds, as 0.04")
        return window

    @property
    def start_utc_ns(self) -> int:
        """UTC (ns) of the start of the campaign."""
        return round(self.start.timestamp() * 1e6) * 1000

    @property
    def window_s(self) -> float:
        """Window length (s): `window`, or the daemon's default for the mains frequency."""
        return self.window or (0.05 if self.mains.frequency > 55 else 0.04)

    def random(self, *stream: int) -> np.random.Generator:
        """Reproducible random numbers, independent for each `stream`."""
        return np.random.default_rng([self.seed, *stream])

    def robot_random(self, cell: int, stream: int) -> np.random.Generator:
        """Reproducible random numbers of the robot itself, the same in every session that measures it."""
        return np.random.default_rng([self.seed if self.robot_seed is None else self.robot_seed, cell, stream])


Profile = Literal["thesis", "use-case"]


class CampaignSettings(LabSettings):
    """A whole measured campaign."""

    profile: Profile = "thesis"
    """use-case: with brake release and a gripped part as undeclared effects, unless `effects` is given."""
    limited: Annotated[int, Field(ge=0, le=100_000)] = 202
    """Recordings in limited space (profile thesis)."""
    all_space: Annotated[int, Field(ge=0, le=100_000)] = 135
    """Recordings in all space (profile thesis)."""
    limited_sources: Annotated[int, Field(ge=1, le=10_000)] = 46
    all_space_sources: Annotated[int, Field(ge=1, le=10_000)] = 30
    assemblies: Annotated[int, Field(ge=1, le=100_000)] = 24
    """Recordings of the assembly (profile use-case)."""
    session: Annotated[int, Field(ge=1, le=10_000)] = 24
    """Recordings per power stream."""
    cells: Annotated[int, Field(ge=1, le=1000)] = 1
    """Virtual robots with different deviations, mains and clocks."""

    @model_validator(mode="before")
    @classmethod
    def _default_effects_of_assemblies(cls, data: Any) -> Any:
        """Two effects that the models of the thesis could not reproduce: brake release, gripped part (ch. 9, 10)."""
        if isinstance(data, dict) and data.get("profile") == "use-case" and "effects" not in data:
            hidden = [
                EffectSpec(id="brake_release", declared=False),
                EffectSpec(id="payload", values={"mass_kg": 0.6, "with_tool": 1.0}, declared=False),
            ]
            return data | {"effects": hidden}
        return data


CAMPAIGN_ONLY = frozenset(CampaignSettings.model_fields) - frozenset(LabSettings.model_fields)
"""Keys that a single execution ignores."""
