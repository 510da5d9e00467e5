"""Slave information interface: the EEPROM's content (ETG.1000.6, 5.4; ETG.2010) and the registers that read it."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from .registers import SII_ADDRESS, SII_CONTROL, SII_DATA, U16, U32

STRINGS: Final = 10
GENERAL: Final = 30
FMMUS: Final = 40
SYNC_MANAGERS: Final = 41
END: Final = 0xFFFF

COE: Final = 0x0004
"""Mailbox protocol CoE (word 0x1C)."""
SDO_AND_ASSIGNMENT: Final = 0x05
"""CoE details: SDO and PDO assignment; neither SDO information nor complete access."""

EIGHT_BYTES: Final = 0x0040
COMMAND: Final = 0x0700
READ: Final = 0x0100
COMMAND_ERROR: Final = 0x2000


@dataclass(frozen=True)
class SyncManager:
    """One entry of the SyncManager category: address and length [byte], control, activation, type."""

    address: int
    length: int
    control: int
    active: int
    kind: int


@dataclass(frozen=True)
class Identity:
    """Who the slave says it is."""

    vendor: int
    product: int
    revision: int
    serial: int
    name: str
    group: str


def image(identity: Identity, managers: tuple[SyncManager, ...] = (), size: int = 2048) -> bytes:
    """EEPROM content of `size` bytes; a slave with SyncManagers has a CoE mailbox in the first two."""
    head = bytearray(128)
    struct.pack_into("<8H", head, 0, 0x0004, 0, 0, 0, 0, 0, 0, 0)
    head[14] = _crc8(bytes(head[:14]))
    struct.pack_into("<4I", head, 0x10, identity.vendor, identity.product, identity.revision, identity.serial)
    if managers:
        out, back = managers[0], managers[1]
        struct.pack_into("<5H", head, 0x30, out.address, out.length, back.address, back.length, COE)
    struct.pack_into("<2H", head, 0x7C, size // 128 - 1, 1)
    return (bytes(head) + _categories(identity, managers)).ljust(size, b"\xff")


def _categories(identity: Identity, managers: tuple[SyncManager, ...]) -> bytes:
    content = _category(STRINGS, _strings(identity.name, identity.group))
    content += _category(GENERAL, _general(bool(managers)))
    if managers:
        content += _category(FMMUS, bytes((1, 2)))
        content += _category(SYNC_MANAGERS, b"".join(_manager(entry) for entry in managers))
    return content + U16.pack(END)


def _category(kind: int, data: bytes) -> bytes:
    data += b"\0" * (len(data) % 2)
    return struct.pack("<2H", kind, len(data) // 2) + data


def _strings(*texts: str) -> bytes:
    return bytes((len(texts),)) + b"".join(bytes((len(text),)) + text.encode("ascii") for text in texts)


def _general(mailbox: bool) -> bytes:
    """Group is string 2, name string 1; 32 bytes."""
    data = bytearray(32)
    data[0], data[3] = 2, 1
    data[2] = 1
    data[5] = SDO_AND_ASSIGNMENT if mailbox else 0
    return bytes(data)


def _manager(entry: SyncManager) -> bytes:
    return struct.pack("<2H4B", entry.address, entry.length, entry.control, 0, entry.active, entry.kind)


def _crc8(data: bytes) -> int:
    """Checksum of the first seven words: x^8 + x^2 + x + 1, start value 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x07 if crc & 0x80 else crc << 1
        crc &= 0xFF
    return crc


def serve(memory: bytearray, content: bytes) -> None:
    """Act on a command in the SII control register: put eight bytes at the word address into the data register.

    Writing is refused with the command error bit: no master has a reason to change this EEPROM.
    """
    command = U16.unpack_from(memory, SII_CONTROL)[0] & COMMAND
    status = EIGHT_BYTES
    if command == READ:
        start = 2 * U32.unpack_from(memory, SII_ADDRESS)[0]
        memory[SII_DATA : SII_DATA + 8] = content[start : start + 8].ljust(8, b"\xff")
    elif command:
        status |= COMMAND_ERROR
    U16.pack_into(memory, SII_CONTROL, status)
