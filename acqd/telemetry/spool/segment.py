"""One file of the spool: rows in the order in which they were made, never changed after they are written.

A segment that was closed ends with an index of its rows, so that opening a large spool reads little; one that was
not (power loss, kill) is read as a whole. The same bytes can be held in memory instead while the disk takes none.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool.record import (
    ENERGY,
    INDEX,
    OVERHEAD,
    REGISTERS,
    ROW,
    Energy,
    Stream,
    index_record,
    record_at,
    records,
)

_MAGIC, _END = b"ACQDSPL1", b"ACQDEND1"
_HEAD = struct.Struct("<8sQ")  # magic, UTC of creation [ns]
_TAIL = struct.Struct("<8sI")  # magic, offset of the index
START = _HEAD.size
"""Offset of the first record."""
_MODE = 0o640


class Segment:
    """Rows in one file (or in memory), and which of them still wait."""

    def __init__(self, number: int, path: Path | None, created_ns: int) -> None:
        self.number, self.path, self.created_ns = number, path, created_ns
        self.size = START
        """Bytes up to the end of the last record."""
        self.pending: dict[Stream, Ranges] = {}
        self.energy: dict[str, Energy] = {}
        """Readings of each device's registers after its last row; "" as device in files of the time of one device."""
        self.registers: dict[str, Sequence[float]] = {}
        """State of each device's other registers then."""
        self.damaged = 0
        """Bytes that could not be read."""
        self._memory = bytearray()
        self._file: int | None = None

    @classmethod
    def create(cls, folder: Path | None, number: int, created_ns: int) -> Segment:
        """An empty segment; without `folder`, in memory. Raises OSError."""
        segment = cls(number, None, created_ns)
        segment._memory += _HEAD.pack(_MAGIC, created_ns)
        if folder is not None:
            segment.to_file(folder)
        return segment

    @classmethod
    def open(cls, path: Path) -> Segment:
        """The segment in a file, damage skipped and a torn end cut off. Raises OSError."""
        with path.open("rb", buffering=0) as file:
            head, size = file.read(START), os.fstat(file.fileno()).st_size
            magic, created_ns = _HEAD.unpack(head) if len(head) == START else (b"", 0)
            if magic != _MAGIC:
                created_ns = path.stat().st_mtime_ns
            segment = cls(int(path.stem), path, created_ns)
            if not segment._read_index(file.fileno(), size):
                segment._scan(path.read_bytes())
        return segment

    def to_file(self, folder: Path) -> None:
        """Move what is in memory to a new file. Raises OSError and changes nothing."""
        path = folder / f"{self.number:016d}.seg"
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_APPEND, _MODE)
        try:
            _write(file, self._memory)
        except OSError:
            os.close(file)
            path.unlink(missing_ok=True)
            raise
        self.path, self._file, self._memory = path, file, bytearray()

    def append(self, data: bytes) -> None:
        """Write whole records with one call. Raises OSError; nothing of `data` is kept then."""
        if self._file is None:
            self._memory += data
        else:
            try:
                _write(self._file, data)
            except OSError:
                os.ftruncate(self._file, self.size)
                raise
        self.size += len(data)

    def close(self) -> None:
        """Write the index: nothing is appended any more. Without room for it the next start reads everything."""
        if self._file is None:
            return
        streams = [[*stream, list(rows)] for stream, rows in self.pending.items()]
        index = index_record(
            json.dumps({"streams": streams, "energy": self.energy, "registers": self.registers}).encode()
        )
        try:
            _write(self._file, index + _TAIL.pack(_END, self.size))
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._file, self.size)
        finally:
            os.close(self._file)
            self._file = None

    def delete(self) -> None:
        """Remove the file. Raises OSError."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    def read(self, offset: int, size: int) -> bytes:
        """At most `size` bytes of records. Raises OSError."""
        size = min(size, self.size - offset)
        if self.path is None:
            return bytes(self._memory[offset : offset + size])
        with self.path.open("rb", buffering=0) as file:
            return os.pread(file.fileno(), size, offset)

    def lose_unreadable(self) -> int:
        """Give up rows that cannot be read any more; how many."""
        try:
            data = self.read(0, self.size)
        except OSError:
            data = b""
        kept = Segment(self.number, None, 0)
        kept._index(data)
        lost = 0
        for stream, rows in list(self.pending.items()):
            there = kept.pending.get(stream, Ranges())
            missing = Ranges(rows)
            for first, last in there:
                missing.remove(first, last)
            for first, last in missing:
                lost += rows.remove(first, last)
            if not rows:
                del self.pending[stream]
        return lost

    def _scan(self, data: bytes) -> None:
        """Find the rows of a segment that was not closed."""
        read = self._index(data)
        self.damaged = max(0, len(data) - START - read)
        if self.path is not None and self.size < len(data):
            os.truncate(self.path, self.size)

    def _index(self, data: bytes) -> int:
        """Note every intact record; their bytes together."""
        intact, before = 0, START
        for record in records(data, START):
            length = len(record.name) + len(record.body)
            if record.kind == ROW:
                self.pending.setdefault(record.stream, Ranges()).add(record.seq, record.seq)
            elif record.kind == ENERGY:
                self.energy[record.device] = record.energy
            elif record.kind == REGISTERS:
                self.registers[record.device] = record.numbers
            intact += length + OVERHEAD
            before = record.end
        self.size = before
        return intact

    def _read_index(self, file: int, size: int) -> bool:
        """Take the rows from the index at the end; False if it is missing or damaged."""
        if size < START + _TAIL.size:
            return False
        magic, offset = _TAIL.unpack(os.pread(file, _TAIL.size, size - _TAIL.size))
        record = record_at(os.pread(file, size, offset), 0) if magic == _END and offset < size else None
        if record is None or record.kind != INDEX:
            return False
        content = json.loads(record.body)
        self.pending = {Stream(*names): Ranges(rows) for *names, rows in content["streams"]}
        self.energy = _energy(content["energy"])
        self.registers = content.get("registers", {})
        self.size = offset
        return True


def _energy(content: Any) -> dict[str, Energy]:
    """Registers by device in an index; registers of one device were a list."""
    devices = content if isinstance(content, dict) else {"": content or []}
    return {name: [(pair[0], pair[1]) for pair in pairs] for name, pairs in devices.items() if pairs}


def _write(file: int, data: bytes | bytearray) -> None:
    """All of `data`. Raises OSError, also where the disk takes only a part."""
    view = memoryview(data)
    while view:
        view = view[os.write(file, view) :]
