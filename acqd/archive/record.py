"""The records of a segment: a mark, the kind, the length, a checksum, and the content.

A segment begins with HEAD and STATE, goes on with CHUNKs and ends with END. What stands in a file after a crash is
known record by record: one whose checksum is right was written whole.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

HEAD, STATE, CHUNK, END = range(1, 5)
MARK = b"\xacAR1"
_FRAME = struct.Struct("<4sBII")  # mark, kind, length of the content, CRC-32 of kind, length and content
OVERHEAD = _FRAME.size
LARGEST = 1 << 28
"""Bytes of a content at most."""


class Record(NamedTuple):
    """One record at its place."""

    offset: int
    kind: int
    body: memoryview
    end: int
    """Offset of the next one."""


def record(kind: int, body: bytes) -> bytes:
    """The bytes of a record."""
    return _FRAME.pack(MARK, kind, len(body), _checksum(kind, body)) + body


def record_at(data: bytes | memoryview, offset: int) -> Record | None:
    """The record at `offset`; None where no whole and unharmed one is."""
    view = memoryview(data)
    if offset + OVERHEAD > len(view):
        return None
    mark, kind, length, checksum = _FRAME.unpack_from(view, offset)
    begin = offset + OVERHEAD
    if mark != MARK or length > LARGEST or begin + length > len(view):
        return None
    body = view[begin : begin + length]
    return Record(offset, kind, body, begin + length) if checksum == _checksum(kind, body) else None


def records(data: bytes, offset: int = 0) -> Iterator[Record]:
    """Every unharmed record from `offset` on; damaged bytes are passed over."""
    while offset + OVERHEAD <= len(data):
        found = record_at(data, offset)
        if found is not None:
            yield found
            offset = found.end
            continue
        offset = data.find(MARK, offset + 1)
        if offset < 0:
            return


def _checksum(kind: int, body: bytes | memoryview) -> int:
    return zlib.crc32(body, zlib.crc32(struct.pack("<BI", kind, len(body))))
