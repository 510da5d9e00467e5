"""`[source]` for devices on Modbus: waveform bridges and RMS meters."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from acqd.daemon.device_section import NOT_OF_THE_SOURCE, DeviceSection
from acqd.daemon.section import Host, Port, Positive
from acqd.section import Section
from acqd.sources.spec import Spec, spec_of


class _LinkKeys(Section):
    """Where a Modbus device is: `host` (TCP) or `serial_port` (RTU, ASCII)."""

    host: Host | None = None
    port: Port = 502
    serial_port: Annotated[str, Field(min_length=1)] | None = None
    baudrate: Annotated[int, Field(ge=300, le=4_000_000)] = 9600
    parity: Literal["N", "E", "O"] = "N"
    stopbits: Literal[1, 2] = 1
    timeout_s: Annotated[float, Field(ge=0.02, le=10)] = 0.3
    framing: Literal["tcp", "rtu", "ascii"] = "tcp"
    echo: bool = False
    databits: Literal[7, 8] = 8

    @model_validator(mode="after")
    def _one_link(self) -> _LinkKeys:
        if (self.host is None) == (self.serial_port is None):
            raise ValueError("give either host (Modbus TCP) or serial_port (Modbus RTU, ASCII)")
        if self.framing == "rtu" and self.host is None:
            raise ValueError('framing = "rtu" belongs to a host; a serial_port has no other unless it says "ascii"')
        if self.databits == 7 and self.framing != "ascii":
            raise ValueError('databits = 7 needs framing = "ascii": bytes of RTU and TCP have 8')
        return self

    def link(self) -> dict[str, Any]:
        """The keys of a ModbusLink."""
        return {name: getattr(self, name) for name in _LinkKeys.model_fields}


class ModbusSection(_LinkKeys, DeviceSection):
    """A waveform bridge."""

    kind: Literal["modbus"]
    unit: Annotated[int, Field(ge=0, le=255)] = 1
    address: Annotated[int, Field(ge=0, le=65_500)] = 0
    connections: Annotated[int, Field(ge=1, le=16)] = 4
    poll_ms: Annotated[int, Field(ge=1, le=500)] = 20

    def spec(self) -> Spec:
        """The source as JSON, for MAIN_FAST's process; the keys of the link become one table."""
        keys = self.model_dump(exclude=set(_LinkKeys.model_fields) | NOT_OF_THE_SOURCE)
        return spec_of(**keys, link=self.link())


class MeterSection(Section):
    """One RMS meter on the link."""

    name: str
    profile: str
    unit: Annotated[int, Field(ge=0, le=255)] | None = None
    word_order: Literal["high", "low"] | None = None
    poll_s: Annotated[float, Field(ge=0.05, le=3600)] | None = None
    nominal_voltage: Positive = 230.0
    rated_current: Positive | None = None


class MetersSection(_LinkKeys):
    """RMS meters: rows from registers, no waveforms."""

    kind: Literal["meters"]
    meters: Annotated[list[MeterSection], Field(min_length=1, max_length=247)]
    simulated: bool = False

    @property
    def nominal_frequency(self) -> float:
        """50 Hz, whatever the mains: meters have no windows that depend on it."""
        return 50.0
