"""AMS/TCP frames as the Beckhoff Information System describes them (TwinCAT ADS, "AMS/TCP packet", "ADS commands")."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

PORT = 48898
"""TCP port of every AMS router."""
PLC_PORT = 851
"""AMS port of the first PLC runtime of TwinCAT 3."""
_TCP = struct.Struct("<HI")
_AMS = struct.Struct("<6sH6sHHHIII")
HEADER_BYTES = _TCP.size + _AMS.size
_MAX_LENGTH = 16 * 1024 * 1024
_REQUEST = 0x0004
_RESPONSE = 0x0005


class Command(IntEnum):
    """ADS command numbers."""

    READ_DEVICE_INFO = 1
    READ = 2
    WRITE = 3
    READ_STATE = 4
    WRITE_CONTROL = 5
    ADD_NOTIFICATION = 6
    DELETE_NOTIFICATION = 7
    NOTIFICATION = 8
    READ_WRITE = 9


class Group(IntEnum):
    """Index groups that this double serves."""

    MEMORY = 0x4040
    HANDLE_BY_NAME = 0xF003
    VALUE_BY_HANDLE = 0xF005
    RELEASE_HANDLE = 0xF006
    INFO_BY_NAME = 0xF007
    INFO_BY_NAME_EX = 0xF009
    UPLOAD = 0xF00B
    UPLOAD_INFO = 0xF00C
    UPLOAD_INFO_2 = 0xF00F
    SUM_READ = 0xF080
    SUM_WRITE = 0xF081


class Code(IntEnum):
    """ADS return codes."""

    TARGET_PORT_NOT_FOUND = 0x006
    TARGET_MACHINE_NOT_FOUND = 0x007
    SERVICE_NOT_SUPPORTED = 0x701
    INVALID_GROUP = 0x702
    INVALID_OFFSET = 0x703
    ACCESS_DENIED = 0x704
    INVALID_SIZE = 0x705
    INVALID_DATA = 0x706
    SYMBOL_NOT_FOUND = 0x710
    NOTIFICATION_HANDLE_INVALID = 0x714


class AdsError(Exception):
    """A request that is answered with an ADS return code."""

    def __init__(self, code: Code) -> None:
        super().__init__(code.name)
        self.code = code


@dataclass(frozen=True)
class Address:
    """AMS net id (6 bytes) and AMS port."""

    net_id: bytes
    port: int


@dataclass(frozen=True)
class Frame:
    """One AMS packet."""

    target: Address
    source: Address
    command: int
    flags: int
    error: int
    invoke_id: int
    data: bytes

    @property
    def is_request(self) -> bool:
        return self.flags & 1 == 0

    def reply(self, data: bytes, error: int = 0) -> Frame:
        """The response to this request; `error` is the AMS header's code (the router's)."""
        return Frame(self.source, self.target, self.command, _RESPONSE, error, self.invoke_id, data)

    def notification(self, data: bytes) -> Frame:
        """A stream of samples to the sender of this AddDeviceNotification request."""
        return Frame(self.source, self.target, Command.NOTIFICATION, _REQUEST, 0, 0, data)

    def encode(self) -> bytes:
        head = _AMS.pack(
            self.target.net_id, self.target.port, self.source.net_id, self.source.port,
            self.command, self.flags, len(self.data), self.error, self.invoke_id,
        )  # fmt: skip
        return _TCP.pack(0, len(head) + len(self.data)) + head + self.data


def take_frame(buffer: bytearray) -> Frame | None:
    """Remove the first packet from `buffer`; None if it is not complete yet.

    Raises ValueError if the lengths contradict each other: then the stream has no packet borders any more.
    """
    if len(buffer) < HEADER_BYTES:
        return None
    length = _TCP.unpack_from(buffer)[1]
    target, target_port, source, source_port, command, flags, size, error, invoke_id = _AMS.unpack_from(
        buffer, _TCP.size
    )
    if length != _AMS.size + size or size > _MAX_LENGTH:
        raise ValueError(f"an AMS/TCP length of {length} does not fit {size} bytes of data")
    end = HEADER_BYTES + size
    if len(buffer) < end:
        return None
    data = bytes(buffer[HEADER_BYTES:end])
    del buffer[:end]
    return Frame(Address(target, target_port), Address(source, source_port), command, flags, error, invoke_id, data)


def net_id_bytes(text: str) -> bytes:
    """`127.0.0.2.1.1` as six bytes."""
    parts = [int(part) for part in text.split(".")]
    if len(parts) != 6:
        raise ValueError(f"an AMS net id has six numbers: {text}")
    return bytes(parts)


def net_id_text(net_id: bytes) -> str:
    """Six bytes as `127.0.0.2.1.1`."""
    return ".".join(str(part) for part in net_id)
