"""`acqd.toml`: every key with its type and default. `config/acqd.toml` explains them to users."""

from __future__ import annotations

import difflib
import logging
import os
import socket
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar, cast, get_args

from pydantic import BaseModel, Field, ValidationError, create_model, field_validator, model_validator

from acqd.daemon import nominal
from acqd.daemon.archive_section import ArchiveSection
from acqd.daemon.box_section import BoxSection
from acqd.daemon.config_place import as_installed
from acqd.daemon.correction_section import CorrectionSection
from acqd.daemon.earlier_files import with_tariff, without_effect
from acqd.daemon.energy_section import EnergySection
from acqd.daemon.events.section import EventsSection
from acqd.daemon.health.section import HealthSection
from acqd.daemon.instance import name_of_host
from acqd.daemon.integration_sections import integration_tables
from acqd.daemon.modbus_sections import MetersSection
from acqd.daemon.mqtt_section import MqttSection, Service
from acqd.daemon.quality_section import QualitySection
from acqd.daemon.registers_section import RegistersSection
from acqd.daemon.section import Positive
from acqd.daemon.source_sections import SECTIONS, SimulatedSection, SourceSection
from acqd.daemon.spool_section import SpoolSection
from acqd.daemon.web_section import WebSection
from acqd.errors import InputError
from acqd.plc.realtime import RealtimeSettings
from acqd.section import FileName, Section
from acqd.storage.sink_settings import SinkSettings
from acqd.telemetry.topics import valid_device

if TYPE_CHECKING:  # SQLAlchemy is slow to import, and a daemon that is started again must not wait for it
    from acqd.storage.maintain import Retention


_log = logging.getLogger(__name__)
Table = TypeVar("Table", bound=Section)


class MeteringSection(Section):
    """How windows become quantities."""

    mode: Literal["synchronous", "fixed"] = "synchronous"
    window: Annotated[float, Field(ge=0.04, le=0.05)] | None = None
    nominal_voltage: Positive = 230.0
    creep_w: Annotated[float, Field(ge=0)] | None = None
    """W per phase below which a window counts no energy, and var below which it counts no reactive energy; None: the
    no-load power of the converter's range (`no_load_W`)."""


class RealtimeSection(Section):
    """Scheduling of MAIN_FAST and MAIN_SLOW."""

    priority: Annotated[int, Field(ge=0, le=99)] = 80
    lock_memory: bool = True
    cpu: Annotated[int, Field(ge=0)] | None = None
    slow_priority: Annotated[int, Field(ge=0, le=99)] = 0

    def settings(self) -> RealtimeSettings:
        """The settings of MAIN_FAST's process."""
        return RealtimeSettings(**self.model_dump(exclude={"slow_priority"}))


class BrokerSection(Section):
    """The embedded broker."""

    embedded: bool = False
    host: str = "127.0.0.1"


class SinkSection(Section):
    """MQTT -> SQL."""

    embedded: bool = False
    database: str = Field(default="acqd.sqlite", repr=False)
    client_id: str = Field(default_factory=lambda: f"acqd-sink-{socket.gethostname()}", min_length=1)
    group: Annotated[str, Field(pattern=r"^[^/+#]*$")] = ""
    batch: Annotated[int, Field(ge=1, le=50_000)] = 2_000
    interval: Annotated[float, Field(gt=0, le=10)] = 0.25
    keep_days: Annotated[float, Field(ge=0)] = 30.0
    keep_1min_days: Annotated[float, Field(ge=0)] = 365.0
    keep_quarantine_days: Annotated[float, Field(ge=0)] = 30.0
    quarantine_mb_per_day: Annotated[float, Field(ge=0)] = 32.0

    def settings(self) -> SinkSettings:
        """The settings of the sink."""
        malformed = self.quarantine_mb_per_day * 2**20
        return SinkSettings(self.client_id, self.group, self.batch, self.interval, malformed)

    def retention(self) -> Retention:
        """The retention times of `acqd sink maintain`."""
        from acqd.storage.maintain import Retention

        return Retention(self.keep_days, self.keep_1min_days, self.keep_quarantine_days)


class _Daemon(Section):
    """What the daemon reads."""

    device: str = "acqd"
    state_dir: FileName | None = None
    source: SourceSection = SimulatedSection()
    boxes: list[BoxSection] = Field(default=[], max_length=64)
    """Several sources, written as [[source]]; then `source` means nothing."""
    metering: MeteringSection = MeteringSection()
    quality: QualitySection = QualitySection()
    registers: RegistersSection = RegistersSection()
    realtime: RealtimeSection = RealtimeSection()
    mqtt: MqttSection = MqttSection()
    spool: SpoolSection = SpoolSection()
    broker: BrokerSection = BrokerSection()
    sink: SinkSection = Field(default_factory=SinkSection)
    events: EventsSection = EventsSection()
    archive: ArchiveSection = ArchiveSection()
    health: HealthSection = HealthSection()
    energy: EnergySection = EnergySection()
    web: WebSection = WebSection()

    @field_validator("device")
    @classmethod
    def _plain_name(cls, name: str) -> str:
        if not valid_device(name):
            raise ValueError("expected 1 to 64 letters, digits, dots, dashes or underscores")
        return name

    @model_validator(mode="before")
    @classmethod
    def _default_kind(cls, data: Any) -> Any:
        source = data.get("source") if isinstance(data, dict) else None
        if isinstance(source, dict) and "kind" not in source:
            return {**data, "source": {"kind": "simulated", **source}}
        if isinstance(source, list):
            return {name: value for name, value in data.items() if name != "source"} | {"boxes": _boxes(source)}
        return data

    @model_validator(mode="after")
    def _different_devices(self) -> Self:
        names = [name for box in self.boxes for name in box.devices]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"two sources have the device {twice[0]!r}; their rows could not be told apart")
        return self

    @model_validator(mode="after")
    def _events_of_samples(self) -> Self:
        if self.events.enabled and all(isinstance(source, MetersSection) for source in self.sources):
            raise ValueError('events.enabled: sources of kind "meters" have no samples; set it to false')
        return self

    @model_validator(mode="after")
    def _archive_of_samples(self) -> Self:
        if self.archive.enabled and all(isinstance(source, MetersSection) for source in self.sources):
            raise ValueError('archive.enabled: sources of kind "meters" have no samples; set it to false')
        return self

    @model_validator(mode="after")
    def _known_voltages(self) -> Self:
        nominal.check(cast("Config", self))
        return self

    @property
    def devices(self) -> list[str]:
        """Devices of the rows."""
        if self.boxes:
            return [name for box in self.boxes for name in box.devices]
        return [meter.name for meter in self.source.meters] if isinstance(self.source, MetersSection) else [self.device]

    @property
    def watched(self) -> list[str]:
        """Devices whose samples are watched for voltage events."""
        return self._sampled if self.events.enabled else []

    @property
    def sources(self) -> list[SourceSection]:
        """Every source."""
        return [box.source for box in self.boxes] or [self.source]

    @property
    def archived(self) -> list[str]:
        """Devices whose samples are kept."""
        return self._sampled if self.archive.enabled else []

    @property
    def _sampled(self) -> list[str]:
        """Devices that have samples."""
        if not self.boxes:
            return [] if isinstance(self.source, MetersSection) else [self.device]
        return [name for box in self.boxes if not isinstance(box.source, MetersSection) for name in box.devices]

    def of_box(self, box: BoxSection) -> Self:
        """The configuration of a daemon that has this box only."""
        return self.model_copy(update={"device": box.device or self.device, "source": box.source, "boxes": []})

    @property
    def window(self) -> float:
        """Window length [s]: as set, else 40 ms at 50 and 400 Hz, 50 ms at 60 Hz, 120 ms at 16 2/3 Hz."""
        if self.metering.window is not None:
            return self.metering.window
        f = self.source.nominal_frequency
        return 0.12 if f < 45 else 0.04 if f < 55 or f > 65 else 0.05

    def table(self, section: type[Table]) -> Table:
        """The table of an integration, by its model."""
        name = next(name for name, known in integration_tables().items() if known is section)
        return cast(Table, getattr(self, name))

    @classmethod
    def demonstration(cls, port: int) -> Self:
        """The configuration of `acqd run` without a file: simulated source, embedded broker and sink."""
        return cls(
            device=name_of_host(),
            mqtt=MqttSection(port=port),
            broker=BrokerSection(embedded=True),
            sink=SinkSection(embedded=True),
        )


if TYPE_CHECKING:

    class Config(_Daemon):
        """The whole file: what the daemon reads, and a table of every integration."""
else:
    Config = create_model(
        "Config",
        __base__=_Daemon,
        __module__=__name__,
        __doc__="The whole file: what the daemon reads, and a table of every integration.",
        **{name: (table, Field(default_factory=table)) for name, table in integration_tables().items()},
    )


def _boxes(tables: list[Any]) -> list[Any]:
    """[[source]] tables: the device next to the source."""
    return [
        {"source": {"kind": "simulated"} | {k: v for k, v in table.items() if k != "device"}}
        | ({"device": table["device"]} if "device" in table else {})
        if isinstance(table, dict)
        else table
        for table in tables
    ]


def load_config(path: Path, service: Service = "daemon") -> Config:
    """Read and check a configuration file, which logs in at the broker as `service` does.

    Raises InputError with one line per mistake.
    """
    data = read_toml(path)
    config = parsed_config(data, path)
    own = data.get("energy", {}).get("tariff")  # by hand, a command may be in another folder than the services
    if own is not None and config.energy.tariff is not None:
        config.energy = config.energy.model_copy(update={"tariff": path.absolute().parent / own})
    state = os.environ.get("STATE_DIRECTORY")
    if config.state_dir is None and state:
        config.state_dir = Path(state)
    as_installed(config, path)
    config.mqtt = config.mqtt.of(service)
    return config


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a file. Raises InputError."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise InputError(path, "no such file; config/acqd.toml in the source tree is a complete example") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, f"cannot be read ({error})") from None
    except (ValueError, RecursionError) as error:  # ValueError: also numbers of more than 4300 digits
        hint = "; several sources are all written as [[source]]" if "'source'" in str(error) else ""
        raise InputError(path, f"is not valid TOML: {error}{hint}") from None


def parsed_config(data: dict[str, Any], path: Path) -> Config:
    """The configuration that tables mean; `path` is named by messages. Raises InputError with one line per mistake."""
    if "boxes" in data:
        raise InputError(path, "unknown key boxes; several sources are written as [[source]] tables")
    data, notes = without_effect(data)
    data, more = with_tariff(data, path)
    for note in notes + more:
        _log.warning("%s: %s", path, note)
    try:
        return Config.model_validate(data)
    except ValidationError as error:
        raise InputError(path, "; ".join(_complaint(fault) for fault in error.errors())) from None


def _complaint(fault: Any) -> str:
    """One pydantic error as a sentence that names the key."""
    place, kind = list(fault["loc"]), ""
    if place[:1] == ["boxes"] and len(place) > 1:
        inner = _complaint({**fault, "loc": place[2:]})
        return f"source {place[1] + 1}: {inner}"
    if not place:
        return str(fault["msg"]).removeprefix("Value error, ")
    if place[0] == "source" and len(place) > 1 and place[1] in _KINDS:  # pydantic names the union's member there
        kind = str(place.pop(1))
    key = ".".join(str(part) for part in place)
    if fault["type"] == "missing":
        return f"{key} is missing" + (f' (kind = "{kind}")' if kind else "")
    if fault["type"] == "union_tag_invalid":
        return f"source.kind: {fault['input'].get('kind')!r} is unknown, expected one of {', '.join(_KINDS)}"
    if fault["type"] != "extra_forbidden":
        expected = _EXPECTED.get(key) or fault["msg"].removeprefix("Value error, ")
        return f"{key}: {expected}{_got(key, fault['input'])}"
    foreign = [name for name, section in _KINDS.items() if key.removeprefix("source.") in section.model_fields]
    if kind and foreign:
        return f"{key} belongs to kind {' or '.join(foreign)}, here kind is {kind}; delete it"
    known = known_keys() if "correction." not in key else _CORRECTIONS
    if isinstance(fault["input"], dict) and len(place) == 1:
        known = [name for name in Config.model_fields if name != "boxes"]
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)
    same_end = [name for name in known if name.rpartition(".")[2] == key.rpartition(".")[2]]
    return f"unknown key {key}; did you mean {' or '.join(same_end or near)}?"


def _got(key: str, value: Any) -> str:
    """What the file says instead, unless that may be a secret: a password, or anything in the place of a section."""
    name = key.rpartition(".")[2]
    plain = isinstance(value, (str, int, float)) and "." in key and name not in SECRET
    shown = str(value).lower() if isinstance(value, bool) else f"{value!r:.60}"  # as TOML writes it
    return f" (got {shown})" if plain or (key in ("device", "state_dir") and isinstance(value, str)) else ""


_KINDS: dict[str, type[Section]] = {
    get_args(section.model_fields["kind"].annotation)[0]: section for section in SECTIONS
}


_CORRECTIONS = [f"source.correction.{name}" for name in CorrectionSection.model_fields]
SECRET = {"password", "password_file", "database", "username", "token", "url", "webhooks", "smtp_password"}
"""Keys whose values are not shown."""
_NET_ID = "expected six numbers like 5.12.34.56.1.1"
_EXPECTED = {
    "source.ams_net_id": _NET_ID,
    "source.local_net_id": _NET_ID,
    "source.range_object": "expected index:subindex in hexadecimal like F800:01, or nothing",
}


def known_keys() -> list[str]:
    """Every key of the file, with its section; `source` has the keys of all kinds."""
    keys = []
    for name, info in Config.model_fields.items():
        section = info.annotation
        if name == "boxes":
            continue  # written as [[source]]
        if name == "source":
            keys += sorted({f"source.{key}" for kind in SECTIONS for key in kind.model_fields})
        elif isinstance(section, type) and issubclass(section, BaseModel):
            keys += [f"{name}.{key}" for key in section.model_fields]
        else:
            keys.append(name)
    return keys
