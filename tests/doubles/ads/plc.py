"""ADS services of the PLC runtime (port 851): every command but the notification stream."""

from __future__ import annotations

import struct
import time
from enum import IntEnum

from tests.doubles.ads.memory import PlcMemory
from tests.doubles.ads.wire import AdsError, Code, Command

_U32 = struct.Struct("<I")
_ACCESS = struct.Struct("<III")
_ACCESS_BOTH = struct.Struct("<IIII")
_CONTROL = struct.Struct("<HHI")
_DEVICE_INFO = struct.Struct("<BBH16s")
_VERSION = (3, 1, 4024)


class State(IntEnum):
    """ADSSTATE."""

    RESET = 2
    RUN = 5
    STOP = 6


class Plc:
    """The runtime's state and its answers."""

    def __init__(self, memory: PlcMemory) -> None:
        self.memory = memory
        self.state: int = State.RUN

    def set_state(self, state: int, now: float) -> None:
        """A PLC that is not in RUN writes no slots; RESET starts it again."""
        if state == State.RESET:
            self.memory.ring.restart(now)
            state = State.RUN
        self.state = state
        if state == State.RUN:
            self.memory.ring.unfreeze(now)
        else:
            self.memory.ring.clock.freeze(now)

    def answer(self, command: int, data: bytes) -> bytes:
        """Payload of the response; an ADS error becomes a return code in the payload."""
        try:
            return self._serve(command, data)
        except AdsError as error:
            code = error.code
        except (struct.error, UnicodeDecodeError):
            code = Code.INVALID_SIZE
        length = b"\0\0\0\0" if command in (Command.READ, Command.READ_WRITE) else b""
        return _U32.pack(code) + length

    def _serve(self, command: int, data: bytes) -> bytes:
        now = time.monotonic()
        match command:
            case Command.READ:
                group, offset, length = _ACCESS.unpack(data)
                return _with_length(self.memory.read(group, offset, length, now))
            case Command.WRITE:
                self.memory.write(*_write_access(data))
                return _U32.pack(0)
            case Command.READ_WRITE:
                group, offset, length, size = _ACCESS_BOTH.unpack_from(data)
                payload = _exactly(data[_ACCESS_BOTH.size :], size)
                return _with_length(self.memory.read_write(group, offset, length, payload, now))
            case Command.READ_STATE:
                return struct.pack("<IHH", 0, self.state, 0)
            case Command.WRITE_CONTROL:
                self.set_state(_CONTROL.unpack_from(data)[0], now)
                return _U32.pack(0)
            case Command.READ_DEVICE_INFO:
                return _U32.pack(0) + _DEVICE_INFO.pack(*_VERSION, b"Plc30 App")
        raise AdsError(Code.SERVICE_NOT_SUPPORTED)


def _with_length(value: bytes) -> bytes:
    return struct.pack("<II", 0, len(value)) + value


def _write_access(data: bytes) -> tuple[int, int, bytes]:
    group, offset, length = _ACCESS.unpack_from(data)
    return group, offset, _exactly(data[_ACCESS.size :], length)


def _exactly(data: bytes, length: int) -> bytes:
    if len(data) != length:
        raise AdsError(Code.INVALID_SIZE)
    return data
