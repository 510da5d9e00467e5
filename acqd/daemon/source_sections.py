"""`[source]` of acqd.toml: one section model per kind, each with its own keys."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from acqd.sources import ChannelMap, SimulationSettings
from acqd.sources.simulated import Sag
from acqd.sources.spec import Spec, replay_spec, simulated_spec, spec_of

Port = Annotated[int, Field(ge=1, le=65_535, strict=True)]
Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]
_Order = Annotated[int, Field(ge=2, le=100)]
_Nominal = Annotated[float, Field(ge=45, le=65)]
_OVERSAMPLING = Literal[0, 1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 80, 100]


class Section(BaseModel):
    """A table of the file: unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class SagSection(Section):
    """One voltage dip."""

    at: Annotated[float, Field(ge=0)]
    duration: Positive
    depth: Share


class SimulatedSection(Section):
    """An EL3783 that is not there."""

    kind: Literal["simulated"] = "simulated"
    phases: Annotated[int, Field(ge=1, le=3)] = 3
    seed: int = 1
    voltage: Annotated[float, Field(gt=0, le=500)] = 230.0
    frequency: _Nominal = 50.0
    frequency_drift: Annotated[float, Field(ge=-1, le=1)] = 0.0
    frequency_wander: Share = 0.02
    noise: Share = 0.0005
    dc: Share = 0.0
    power: Annotated[float, Field(ge=0, le=2000)] = 180.0
    power_factor: Annotated[float, Field(gt=0, le=1)] = 0.9
    current_range: Literal[1, 5] = 5
    harmonics: dict[_Order, Share] = {3: 0.01, 5: 0.02, 7: 0.01}
    current_harmonics: dict[_Order, Share] = {3: 0.15, 5: 0.08, 7: 0.04}
    load_profile: Path | None = None
    sags: list[SagSection] = []

    @property
    def nominal_frequency(self) -> float:
        """Hz."""
        return 60.0 if self.frequency > 55 else 50.0

    def spec(self) -> Spec:
        """For the fast process."""
        values = {name: getattr(self, name) for name in type(self).model_fields.keys() - {"kind", "sags"}}
        sags = tuple(Sag(sag.at, sag.duration, sag.depth) for sag in self.sags)
        return simulated_spec(SimulationSettings(**values, sags=sags))


class ReplaySection(Section):
    """A recorded waveform in real time."""

    kind: Literal["replay"]
    file: Path
    loops: Annotated[int, Field(ge=0)] = 1
    map: str | None = None
    u_scale: Positive | None = None
    i_scale: Positive | None = None
    rate: Positive | None = None
    f_nominal: _Nominal | None = None

    @property
    def nominal_frequency(self) -> float:
        """Hz."""
        return self.f_nominal or 50.0

    def spec(self) -> Spec:
        """For the fast process. Raises UserError for a map that cannot be read."""
        columns = ChannelMap.parse(self.map, "source.map") if self.map else None
        return replay_spec(
            self.file, ChannelMap(columns, self.u_scale, self.i_scale, self.rate, self.f_nominal), self.loops
        )


class _DeviceSection(Section):
    """What sources with transformers before them have in common."""

    f_nominal: _Nominal = 50.0
    vt_ratio: Positive = 1.0
    ct_ratio: Positive = 1.0
    simulated: bool = False

    @property
    def nominal_frequency(self) -> float:
        """Hz."""
        return self.f_nominal

    def spec(self) -> Spec:
        """For the fast process."""
        return spec_of(**self.model_dump())


class EthercatSection(_DeviceSection):
    """EL3783 terminals behind a coupler."""

    kind: Literal["ethercat"]
    interface: Annotated[str, Field(min_length=1)]
    terminals: Annotated[int, Field(ge=1, le=3)] = 1
    phases: Annotated[list[str], Field(min_length=1, max_length=3)] = ["1:L1", "1:L2", "1:L3"]
    oversampling: _OVERSAMPLING = 0
    sample_ns: Annotated[int, Field(ge=50_000, le=500_000)] = 50_000
    current_range: Literal["1A", "5A", "auto"] = "5A"
    receive_us: Annotated[int, Field(ge=100, le=1_000_000)] = 2_000
    range_object: Annotated[str, Field(pattern=r"^([0-9A-Fa-f]{4}:[0-9A-Fa-f]{2})?$")] = "F800:01"


class AdsSection(_DeviceSection):
    """A TwinCAT PC."""

    kind: Literal["ads"]
    host: Annotated[str, Field(min_length=1)]
    ams_net_id: Annotated[str, Field(pattern=r"^\d{1,3}(\.\d{1,3}){5}$")]
    ams_port: Port = 851
    local_net_id: Annotated[str, Field(pattern=r"^\d{1,3}(\.\d{1,3}){5}$")] | None = None
    namespace: Annotated[str, Field(min_length=1)] = "GVL_Acqd"
    poll_ms: Annotated[int, Field(ge=1, le=100)] = 20


class SampledValuesSection(_DeviceSection):
    """A merging unit."""

    kind: Literal["sampled-values"]
    interface: Annotated[str, Field(min_length=1)]
    svid: str | None = None
    appid: Annotated[int, Field(ge=0, le=0xFFFF)] | None = None
    rate: Positive | None = None
    channels: Annotated[list[Annotated[int, Field(ge=0, le=63)]], Field(min_length=2, max_length=6)] = [
        4, 0, 5, 1, 6, 2,
    ]  # fmt: skip
    u_scale: Positive = 0.01
    i_scale: Positive = 0.001

    @model_validator(mode="after")
    def _pairs(self) -> SampledValuesSection:
        if len(self.channels) % 2 or len(set(self.channels)) < len(self.channels):
            raise ValueError("channels: expected different positions of U1, I1, U2, I2, ... in pairs")
        return self


class _LinkKeys(Section):
    """Where a Modbus device is: `host` (TCP) or `serial_port` (RTU)."""

    host: Annotated[str, Field(min_length=1)] | None = None
    port: Port = 502
    serial_port: Annotated[str, Field(min_length=1)] | None = None
    baudrate: Annotated[int, Field(ge=300, le=4_000_000)] = 9600
    parity: Literal["N", "E", "O"] = "N"
    stopbits: Literal[1, 2] = 1
    timeout_s: Annotated[float, Field(ge=0.02, le=10)] = 0.3

    @model_validator(mode="after")
    def _one_link(self) -> _LinkKeys:
        if (self.host is None) == (self.serial_port is None):
            raise ValueError("give either host (Modbus TCP) or serial_port (Modbus RTU)")
        return self

    def link(self) -> dict[str, Any]:
        """The keys of a ModbusLink."""
        return {name: getattr(self, name) for name in _LinkKeys.model_fields}


class ModbusSection(_LinkKeys, _DeviceSection):
    """A waveform bridge."""

    kind: Literal["modbus"]
    unit: Annotated[int, Field(ge=0, le=255)] = 1
    address: Annotated[int, Field(ge=0, le=65_500)] = 0
    connections: Annotated[int, Field(ge=1, le=16)] = 4
    poll_ms: Annotated[int, Field(ge=1, le=500)] = 20

    def spec(self) -> Spec:
        """For the fast process."""
        own = self.model_dump(exclude=set(_LinkKeys.model_fields))
        return spec_of(**own, link=self.link())


class MeterSection(Section):
    """One RMS meter on the link."""

    name: str
    profile: str
    unit: Annotated[int, Field(ge=0, le=255)] | None = None
    word_order: Literal["high", "low"] | None = None
    poll_s: Annotated[float, Field(ge=0.05, le=3600)] | None = None
    nominal_voltage: Positive = 230.0


class MetersSection(_LinkKeys):
    """RMS meters: rows from registers, no waveforms."""

    kind: Literal["meters"]
    meters: Annotated[list[MeterSection], Field(min_length=1, max_length=247)]
    simulated: bool = False

    @property
    def nominal_frequency(self) -> float:
        """Hz; meters have no windows."""
        return 50.0


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
