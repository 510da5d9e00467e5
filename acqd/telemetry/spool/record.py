"""Records of the spool: a mark, kind, lengths and a CRC-32, then the body.

A reader that meets damage continues at the next mark whose CRC is right, so that a torn write or a bad block
costs only the records that it hit.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias
from zlib import crc32

from acqd.uptime import Moment

Energy: TypeAlias = list[tuple[float, float]]
"""Imported and exported energy of each phase [kWh]."""
ROW, ENERGY, INDEX, REGISTERS, BEGUN = 1, 2, 3, 4, 5
_MARK = b"\xac\xd1"
_HEAD = struct.Struct("<2sBHI")  # mark, kind, bytes of the stream's name, bytes of the body
_CRC = struct.Struct("<I")
_SEQ = struct.Struct("<Q")
_MOMENT = struct.Struct("<16sQ")
OVERHEAD = _HEAD.size + _CRC.size
"""Bytes of a record besides the name of the stream and the body."""
LONGEST = 1 << 20
"""Bytes of a body at most; a longer length is damage."""


class Window(NamedTuple):
    """A window of a run: its rows have this number."""

    boot: str
    seq: int


class Readings(NamedTuple):
    """What a device's registers say after a window."""

    energy: Energy
    registers: Sequence[float] | None = None
    """State of the others, reactive energy and demand, as numbers; NaN where nothing is known."""
    after: Window | None = None
    """The window, in readings of the spool."""


class Stream(NamedTuple):
    """What numbers rows: `seq` counts up within it."""

    device: str
    channel: str
    boot: str

    def encoded(self) -> bytes:
        """The name in a record."""
        return "\n".join(self).encode()


@dataclass(frozen=True, slots=True)
class Record:
    """One record; `end` is the offset of the next one."""

    kind: int
    name: bytes
    body: bytes
    end: int

    @property
    def stream(self) -> Stream:
        """The stream of a row."""
        device, channel, boot = self.name.decode().split("\n")
        return Stream(device, channel, boot)

    @property
    def seq(self) -> int:
        """Number of a row."""
        return int(_SEQ.unpack_from(self.body)[0])

    @property
    def payload(self) -> bytes:
        """MQTT payload of a row."""
        return self.body[_SEQ.size :]

    @property
    def device(self) -> str:
        """Whose registers a record of that kind holds; empty in records of the time of one device."""
        return self.name.decode()

    @property
    def energy(self) -> Energy:
        """Registers, of a record of that kind."""
        values = self.numbers
        return list(zip(values[::2], values[1::2], strict=True))

    @property
    def begun(self) -> Moment:
        """When the segment was begun, of a record of that kind."""
        return Moment(*_MOMENT.unpack(self.body))

    @property
    def numbers(self) -> tuple[float, ...]:
        """Of a record of registers."""
        return struct.unpack(f"<{len(self.body) // 8}d", self.body)


def row_record(name: bytes, seq: int, payload: bytes) -> bytes:
    """A row of the stream `name`."""
    return _record(ROW, name, _SEQ.pack(seq) + payload)


def energy_record(device: str, energy: Energy) -> bytes:
    """Readings of a device's registers."""
    values = [value for pair in energy for value in pair]
    return _record(ENERGY, device.encode(), struct.pack(f"<{len(values)}d", *values))


def registers_record(device: str, numbers: Sequence[float]) -> bytes:
    """State of a device's registers besides energy."""
    return _record(REGISTERS, device.encode(), struct.pack(f"<{len(numbers)}d", *numbers))


def begun_record(begun: Moment) -> bytes:
    """When a segment was begun."""
    return _record(BEGUN, b"", _MOMENT.pack(*begun))


def index_record(content: bytes) -> bytes:
    """What a closed segment holds."""
    return _record(INDEX, b"", content)


def _record(kind: int, name: bytes, body: bytes) -> bytes:
    head = _HEAD.pack(_MARK, kind, len(name), len(body))
    tail = name + body
    return head + _CRC.pack(crc32(tail, crc32(head))) + tail


def record_at(data: bytes, offset: int) -> Record | None:
    """The record that begins at `offset`; None when it is damaged or incomplete."""
    if offset + OVERHEAD > len(data):
        return None
    mark, kind, name_bytes, body_bytes = _HEAD.unpack_from(data, offset)
    start = offset + OVERHEAD
    end = start + name_bytes + body_bytes
    if mark != _MARK or body_bytes > LONGEST or end > len(data):
        return None
    tail = data[start:end]
    if _CRC.unpack_from(data, offset + _HEAD.size)[0] != crc32(tail, crc32(data[offset : offset + _HEAD.size])):
        return None
    return Record(kind, tail[:name_bytes], tail[name_bytes:], end)


def needed_at(data: bytes, offset: int) -> int:
    """Bytes that the record at `offset` needs according to its head; 0 when that is no head."""
    if offset + OVERHEAD > len(data):
        return OVERHEAD
    mark, _, name_bytes, body_bytes = _HEAD.unpack_from(data, offset)
    return OVERHEAD + name_bytes + body_bytes if mark == _MARK and body_bytes <= LONGEST else 0


def records(data: bytes, offset: int = 0) -> Iterator[Record]:
    """Every intact record from `offset` on, damage skipped."""
    while offset < len(data):
        record = record_at(data, offset)
        if record is not None:
            yield record
            offset = record.end
        else:
            offset = data.find(_MARK, offset + 1)
            if offset < 0:
                return
