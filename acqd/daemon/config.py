"""`acqd.toml`: every key, its default and what it means. `config/acqd.toml` explains them to users."""

from __future__ import annotations

import difflib
import os
import socket
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from acqd.errors import InputError
from acqd.plc.realtime import RealtimeSettings
from acqd.sources import ChannelMap, SimulationSettings
from acqd.sources.simulated import Sag
from acqd.sources.spec import Spec, replay_spec, simulated_spec
from acqd.storage.maintain import Retention
from acqd.storage.sink import SinkSettings
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.topics import valid_device

_Port = Annotated[int, Field(ge=1, le=65_535, strict=True)]
_Order = Annotated[int, Field(ge=2, le=100)]
_Share = Annotated[float, Field(ge=0, le=1)]
_Positive = Annotated[float, Field(gt=0)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class SagSection(_Section):
    """One voltage dip."""

    at: Annotated[float, Field(ge=0)]
    duration: _Positive
    depth: _Share


class SourceSection(_Section):
    """Where samples come from."""

    kind: Literal["simulated", "replay"] = "simulated"
    # simulated
    phases: Annotated[int, Field(ge=1, le=3)] = 3
    seed: int = 1
    voltage: Annotated[float, Field(gt=0, le=500)] = 230.0
    frequency: Annotated[float, Field(ge=45, le=65)] = 50.0
    frequency_drift: Annotated[float, Field(ge=-1, le=1)] = 0.0
    frequency_wander: Annotated[float, Field(ge=0, le=1)] = 0.02
    noise: _Share = 0.0005
    dc: _Share = 0.0
    power: Annotated[float, Field(ge=0, le=2000)] = 180.0
    power_factor: Annotated[float, Field(gt=0, le=1)] = 0.9
    current_range: Literal[1, 5] = 5
    harmonics: dict[_Order, _Share] = {3: 0.01, 5: 0.02, 7: 0.01}
    current_harmonics: dict[_Order, _Share] = {3: 0.15, 5: 0.08, 7: 0.04}
    load_profile: Path | None = None
    sags: list[SagSection] = []
    # replay
    file: Path | None = None
    loops: Annotated[int, Field(ge=0)] = 1

    def spec(self) -> Spec:
        """For the fast process."""
        if self.kind == "replay":
            assert self.file is not None
            return replay_spec(self.file, ChannelMap(), self.loops)
        names = SimulationSettings.__dataclass_fields__.keys() & type(self).model_fields.keys()
        values = {name: getattr(self, name) for name in names - {"sags"}}
        sags = tuple(Sag(sag.at, sag.duration, sag.depth) for sag in self.sags)
        return simulated_spec(SimulationSettings(**values, sags=sags))


class MeteringSection(_Section):
    """How windows become quantities."""

    mode: Literal["synchronous", "fixed"] = "synchronous"
    window: Annotated[float, Field(ge=0.04, le=0.05)] | None = None
    nominal_voltage: _Positive = 230.0


class RealtimeSection(_Section):
    """MAIN_FAST's scheduling."""

    priority: Annotated[int, Field(ge=0, le=99)] = 80
    lock_memory: bool = True
    cpu: Annotated[int, Field(ge=0)] | None = None

    def settings(self) -> RealtimeSettings:
        """As the fast process takes them."""
        return RealtimeSettings(**self.model_dump())


class MqttSection(_Section):
    """The broker, for the daemon, the sink and the viewers."""

    enabled: bool = True
    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    port: _Port = 1883
    username: str | None = None
    password: str | None = None
    password_file: Path | None = None
    tls: bool = False
    ca_file: Path | None = None
    cert_file: Path | None = None
    key_file: Path | None = None
    queue: Annotated[int, Field(ge=100, le=10_000_000)] = 100_000

    def address(self) -> BrokerAddress:
        """Where and how to connect. Raises InputError for an unreadable password file."""
        password = self.password
        if self.password_file is not None:
            try:
                password = self.password_file.read_text(encoding="utf-8").strip()
            except (OSError, UnicodeDecodeError) as error:
                raise InputError(self.password_file, f"password file cannot be read ({error})") from None
        names = ("host", "port", "username", "tls", "ca_file", "cert_file", "key_file")
        return BrokerAddress(**{name: getattr(self, name) for name in names}, password=password)


class BrokerSection(_Section):
    """The embedded broker."""

    embedded: bool = False
    host: str = "127.0.0.1"


class SinkSection(_Section):
    """MQTT -> SQL."""

    embedded: bool = False
    database: str = "acqd.sqlite"
    client_id: str = Field(default_factory=lambda: f"acqd-sink-{socket.gethostname()}", min_length=1)
    group: Annotated[str, Field(pattern=r"^[^/+#]*$")] = ""
    batch: Annotated[int, Field(ge=1, le=50_000)] = 2_000
    interval: Annotated[float, Field(gt=0, le=10)] = 0.25
    keep_days: Annotated[float, Field(ge=0)] = 30.0
    keep_1min_days: Annotated[float, Field(ge=0)] = 365.0
    keep_quarantine_days: Annotated[float, Field(ge=0)] = 30.0

    def settings(self) -> SinkSettings:
        """As the sink takes them."""
        return SinkSettings(self.client_id, self.group, self.batch, self.interval)

    def retention(self) -> Retention:
        """As `maintain` takes it."""
        return Retention(self.keep_days, self.keep_1min_days, self.keep_quarantine_days)


class Config(_Section):
    """The whole file."""

    device: str = "acqd"
    state_dir: Path | None = None
    source: SourceSection = SourceSection()
    metering: MeteringSection = MeteringSection()
    realtime: RealtimeSection = RealtimeSection()
    mqtt: MqttSection = MqttSection()
    broker: BrokerSection = BrokerSection()
    sink: SinkSection = Field(default_factory=SinkSection)

    @field_validator("device")
    @classmethod
    def _plain_name(cls, name: str) -> str:
        if not valid_device(name):
            raise ValueError("expected 1 to 64 letters, digits, dots, dashes or underscores")
        return name

    @property
    def window(self) -> float:
        """Window length [s]: as set, else 40 ms at 50 Hz and 50 ms at 60 Hz."""
        if self.metering.window is not None:
            return self.metering.window
        return 0.05 if self.source.kind == "simulated" and self.source.frequency > 55 else 0.04

    @classmethod
    def demonstration(cls, port: int) -> Config:
        """What `acqd run` does without a file: everything in one place."""
        return cls(mqtt=MqttSection(port=port), broker=BrokerSection(embedded=True), sink=SinkSection(embedded=True))


def load_config(path: Path) -> Config:
    """Read and check a configuration file. Raises InputError with one line per mistake."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise InputError(path, "no such file; config/acqd.toml in the source tree is a complete example") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, f"cannot be read ({error})") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, f"is not valid TOML: {error}") from None
    try:
        config = Config.model_validate(data)
    except ValidationError as error:
        raise InputError(path, "; ".join(_complaint(fault) for fault in error.errors())) from None
    if config.source.kind == "replay" and config.source.file is None:
        raise InputError(path, 'source.file is missing: source.kind = "replay" needs the waveform to replay')
    state = os.environ.get("STATE_DIRECTORY")
    if config.state_dir is None and state:
        config.state_dir = Path(state)
    return config


def _complaint(fault: Any) -> str:
    key = ".".join(str(part) for part in fault["loc"])
    if fault["type"] != "extra_forbidden":
        return f"{key}: {fault['msg'].removeprefix('Value error, ')} (got {fault['input']!r:.60})"
    known = _known_keys()
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)
    same_end = [name for name in known if name.rpartition(".")[2] == key.rpartition(".")[2]]
    return f"unknown key {key}; did you mean {(same_end or near)[0]}?"


def _known_keys() -> list[str]:
    keys = []
    for name, info in Config.model_fields.items():
        section = info.annotation
        if isinstance(section, type) and issubclass(section, BaseModel):
            keys += [f"{name}.{key}" for key in section.model_fields]
        else:
            keys.append(name)
    return keys
