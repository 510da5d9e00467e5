"""Where a Modbus device is, and what the user says about a waveform bridge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Framing: TypeAlias = Literal["tcp", "rtu", "ascii"]


@dataclass(frozen=True, slots=True)
class ModbusLink:
    """One TCP server or one serial line."""

    host: str | None = None
    """TCP; None: serial."""
    port: int = 502
    serial_port: str | None = None
    """RTU or ASCII: "/dev/ttyUSB0"."""
    baudrate: int = 9600
    parity: Literal["N", "E", "O"] = "N"
    stopbits: Literal[1, 2] = 1
    timeout_s: float = 0.3
    """How long an answer may take [s]."""
    framing: Framing = "tcp"
    """Of a host: "rtu" or "ascii" where a gateway passes the frames of its serial line on as they are. Of a serial
    port: "ascii"; anything else is RTU."""
    echo: bool = False
    """Serial: the adapter returns every request before the answer. An echo is also recognised without this."""
    databits: Literal[7, 8] = 8
    """Of a character on the serial line; 7 for ASCII alone."""

    @property
    def is_serial(self) -> bool:
        """Whether frames are those of a serial line: nothing in them names the request that an answer is for."""
        return self.host is None or self.framing != "tcp"

    @property
    def characters(self) -> int:
        """That each byte of a frame takes on a serial line."""
        return 2 if self.framing == "ascii" else 1

    def __str__(self) -> str:
        return f"{self.host}:{self.port}" if self.host else f"{self.serial_port} at {self.baudrate} Bd"


@dataclass(frozen=True, slots=True)
class BridgeSettings:
    """One waveform bridge."""

    link: ModbusLink
    unit: int = 1
    """Modbus unit id."""
    address: int = 0
    """First register of the header."""
    connections: int = 4
    """Parallel TCP connections: one answer at a time and connection."""
    poll_ms: int = 20
    """How often new blocks are fetched [ms]."""
    f_nominal: float = 50.0
    """Declared mains frequency [Hz]."""
    vt_ratio: float = 1.0
    """Voltage transformer, primary / secondary."""
    ct_ratio: float = 1.0
    """Current transformer, primary / secondary."""
