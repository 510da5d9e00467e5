"""`[source]` of acqd.toml: one section model per kind, with the keys of that kind."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from acqd.daemon.device_section import NOT_OF_THE_SOURCE, DeviceSection, WaveformKeys
from acqd.daemon.modbus_sections import MetersSection, ModbusSection
from acqd.daemon.section import Host, Nominal, Port, Positive, Share
from acqd.metering.block import nominal_near
from acqd.section import KEY, FileName, Section
from acqd.sources import ChannelMap, SimulationSettings
from acqd.sources.simulated import Sag
from acqd.sources.spec import Spec, replay_spec, simulated_spec
from acqd.sources.text_file import check_encoding

_Order = Annotated[int, KEY, Field(ge=2, le=100)]
_Position = Annotated[int, Field(ge=0, le=63)]
_Period = Annotated[int, Field(ge=1, le=40)]
_OVERSAMPLING = Literal[0, 1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 80, 100]


class SagSection(Section):
    """One voltage dip."""

    at: Annotated[float, Field(ge=0)]
    duration: Positive
    depth: Share


class SimulatedSection(WaveformKeys):
    """A simulated EL3783."""

    must_exist = ("load_profile",)
    kind: Literal["simulated"] = "simulated"
    phases: Annotated[int, Field(ge=1, le=3)] = 3
    seed: int = 1
    voltage: Annotated[float, Field(gt=0, le=500)] = 230.0
    frequency: Nominal = 50.0
    frequency_drift: Annotated[float, Field(ge=-1, le=1)] = 0.0
    frequency_wander: Share = 0.02
    noise: Share = 0.0005
    dc: Share = 0.0
    power: Annotated[float, Field(ge=0, le=2000)] = 180.0
    power_factor: Annotated[float, Field(gt=0, le=1)] = 0.9
    current_range: Literal[1, 5] = 5
    harmonics: dict[_Order, Share] = Field(default={3: 0.01, 5: 0.02, 7: 0.01})
    current_harmonics: dict[_Order, Share] = Field(default={3: 0.15, 5: 0.08, 7: 0.04})
    load_profile: FileName | None = None
    sags: list[SagSection] = Field(default=[])
    period_ms: _Period = 1

    @property
    def nominal_frequency(self) -> float:
        """Hz."""
        return nominal_near(self.frequency)

    def spec(self) -> Spec:
        """The source as JSON, for MAIN_FAST's process."""
        others = {"kind", "sags", "period_ms"} | NOT_OF_THE_SOURCE
        values = {name: getattr(self, name) for name in type(self).model_fields.keys() - others}
        sags = tuple(Sag(sag.at, sag.duration, sag.depth) for sag in self.sags)
        return simulated_spec(SimulationSettings(**values, sags=sags)) | {"period_ms": self.period_ms}


class ReplaySection(WaveformKeys):
    """A recorded waveform in real time."""

    must_exist = ("file",)
    kind: Literal["replay"]
    file: FileName
    loops: Annotated[int, Field(ge=0)] = 1
    map: str | None = None
    u_scale: Positive | None = None
    i_scale: Positive | None = None
    rate: Positive | None = None
    f_nominal: Nominal | None = None
    encoding: str | None = None
    layout: str | None = None
    period_ms: _Period = 10

    @property
    def nominal_frequency(self) -> float:
        """Hz."""
        return self.f_nominal or 50.0

    def spec(self) -> Spec:
        """The source as JSON, for MAIN_FAST's process. Raises UserError for an impossible map or encoding."""
        columns = ChannelMap.parse(self.map, "source.map") if self.map else None
        encoding = check_encoding(self.encoding, "source.encoding") if self.encoding else None
        channels = ChannelMap(columns, self.u_scale, self.i_scale, self.rate, self.f_nominal, encoding, self.layout)
        return replay_spec(self.file, channels, self.loops) | {"period_ms": self.period_ms}


class EthercatSection(DeviceSection):
    """EL3783 terminals behind a coupler."""

    kind: Literal["ethercat"]
    interface: Annotated[str, Field(min_length=1)]
    terminals: Annotated[int, Field(ge=1, le=3)] = 1
    phases: list[str] = Field(default=["1:L1", "1:L2", "1:L3"], min_length=1, max_length=3)
    oversampling: _OVERSAMPLING = 0
    sample_ns: Annotated[int, Field(ge=50_000, le=500_000)] = 50_000
    current_range: Literal["1A", "5A", "auto"] = "5A"
    receive_us: Annotated[int, Field(ge=100, le=1_000_000)] = 2_000
    range_object: Annotated[str, Field(pattern=r"^([0-9A-Fa-f]{4}:[0-9A-Fa-f]{2})?$")] = "F800:01"


class AdsSection(DeviceSection):
    """A TwinCAT PC."""

    kind: Literal["ads"]
    host: Host
    ams_net_id: Annotated[str, Field(pattern=r"^\d{1,3}(\.\d{1,3}){5}$")]
    ams_port: Port = 851
    local_net_id: Annotated[str, Field(pattern=r"^\d{1,3}(\.\d{1,3}){5}$")] | None = None
    namespace: Annotated[str, Field(min_length=1)] = "GVL_Acqd"
    poll_ms: Annotated[int, Field(ge=1, le=100)] = 20


class SampledValuesSection(DeviceSection):
    """A merging unit."""

    kind: Literal["sampled-values"]
    interface: Annotated[str, Field(min_length=1)]
    svid: str | None = None
    appid: Annotated[int, Field(ge=0, le=0xFFFF)] | None = None
    rate: Positive | None = None
    channels: list[_Position] = Field(default=[4, 0, 5, 1, 6, 2], min_length=2, max_length=6)
    u_scale: Positive = 0.01
    i_scale: Positive = 0.001

    @model_validator(mode="after")
    def _pairs(self) -> SampledValuesSection:
        if len(self.channels) % 2 or len(set(self.channels)) < len(self.channels):
            raise ValueError("channels: expected different positions of U1, I1, U2, I2, ... in pairs")
        return self


WaveformSection = SimulatedSection | ReplaySection | EthercatSection | AdsSection | SampledValuesSection | ModbusSection
SourceSection = Annotated[WaveformSection | MetersSection, Field(discriminator="kind")]
"""What [source] may be; `kind` decides."""
SECTIONS: tuple[type[Section], ...] = (
    SimulatedSection,
    ReplaySection,
    EthercatSection,
    AdsSection,
    ModbusSection,
    SampledValuesSection,
    MetersSection,
)
