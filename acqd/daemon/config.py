"""`acqd.toml`: every key with its type and default. `config/acqd.toml` explains them to users."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar, cast

from pydantic import ConfigDict, Field, create_model, field_validator, model_validator

from acqd.daemon import nominal
from acqd.daemon.archive_section import ArchiveSection
from acqd.daemon.box_section import BoxSection
from acqd.daemon.energy_section import EnergySection
from acqd.daemon.events.section import EventsSection
from acqd.daemon.health.section import HealthSection
from acqd.daemon.instance import name_of_host
from acqd.daemon.integration_sections import integration_tables
from acqd.daemon.modbus_sections import MetersSection
from acqd.daemon.mqtt_section import MqttSection
from acqd.daemon.quality_section import QualitySection
from acqd.daemon.registers_section import RegistersSection
from acqd.daemon.section import BrokerName, Host, Positive
from acqd.daemon.source_sections import SimulatedSection, SourceSection
from acqd.daemon.spool_section import SpoolSection
from acqd.daemon.web_section import WebSection
from acqd.plc.realtime import RealtimeSettings
from acqd.section import FileName, Section
from acqd.storage.sink_settings import SinkSettings
from acqd.telemetry.topics import valid_device

if TYPE_CHECKING:  # SQLAlchemy is slow to import, and a daemon that is started again must not wait for it
    from acqd.storage.maintain import Retention

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
    host: Host = "127.0.0.1"


class SinkSection(Section):
    """MQTT -> SQL."""

    embedded: bool = False
    database: str = Field(default="acqd.sqlite", min_length=1, repr=False)
    client_id: BrokerName = Field(default_factory=lambda: f"acqd-sink-{socket.gethostname()}", min_length=1)
    group: Annotated[BrokerName, Field(pattern=r"^[^/+#]*$")] = ""
    batch: Annotated[int, Field(ge=1, le=50_000)] = 2_000
    interval: Annotated[float, Field(gt=0, le=10)] = 0.25
    keep_days: Annotated[float, Field(ge=0)] | None = None
    """None: 30, or fewer where the disk has no room for so many."""
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

        days = Retention().power_days if self.keep_days is None else self.keep_days
        return Retention(days, self.keep_1min_days, self.keep_quarantine_days, fits_disk=self.keep_days is None)


class _Daemon(Section):
    """What the daemon reads."""

    model_config = ConfigDict(defer_build=True)  # `Config` alone is used: to build both takes a tenth of a start
    device: str = "acqd"
    state_dir: FileName | None = None
    source: SourceSection = SimulatedSection()
    sources: list[BoxSection] = Field(default=[], max_length=64)
    """Of several boxes, written as [[source]]; then `source` means nothing."""
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
            return {name: value for name, value in data.items() if name != "source"} | {"sources": _tables(source)}
        return data

    @model_validator(mode="after")
    def _different_devices(self) -> Self:
        names = [name for box in self.sources for name in box.devices]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"two sources have the device {twice[0]!r}; their rows could not be told apart")
        return self

    @model_validator(mode="after")
    def _events_of_samples(self) -> Self:
        if self.events.enabled and all(isinstance(source, MetersSection) for source in self.every_source):
            raise ValueError('events.enabled: sources of kind "meters" have no samples; set it to false')
        return self

    @model_validator(mode="after")
    def _archive_of_samples(self) -> Self:
        if self.archive.enabled and all(isinstance(source, MetersSection) for source in self.every_source):
            raise ValueError('archive.enabled: sources of kind "meters" have no samples; set it to false')
        return self

    @model_validator(mode="after")
    def _known_voltages(self) -> Self:
        nominal.check(cast("Config", self))
        return self

    @property
    def devices(self) -> list[str]:
        """Devices of the rows."""
        if self.sources:
            return [name for box in self.sources for name in box.devices]
        return [meter.name for meter in self.source.meters] if isinstance(self.source, MetersSection) else [self.device]

    @property
    def watched(self) -> list[str]:
        """Devices whose samples are watched for voltage events."""
        return self.sampled if self.events.enabled else []

    @property
    def every_source(self) -> list[SourceSection]:
        """The source, or those of all tables [[source]]."""
        return [each.source for each in self.sources] or [self.source]

    @property
    def archived(self) -> list[str]:
        """Devices whose samples are kept."""
        return self.sampled if self.archive.enabled else []

    @property
    def sampled(self) -> list[str]:
        """Devices that have samples."""
        if not self.sources:
            return [] if isinstance(self.source, MetersSection) else [self.device]
        return [name for box in self.sources if not isinstance(box.source, MetersSection) for name in box.devices]

    def of_source(self, box: BoxSection) -> Self:
        """The configuration of a daemon that has this box only."""
        return self.model_copy(update={"device": box.device or self.device, "source": box.source, "sources": []})

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


def _tables(tables: list[Any]) -> list[Any]:
    """[[source]] tables: the device next to the source."""
    return [
        {"source": {"kind": "simulated"} | {k: v for k, v in table.items() if k != "device"}}
        | ({"device": table["device"]} if "device" in table else {})
        if isinstance(table, dict)
        else table
        for table in tables
    ]
