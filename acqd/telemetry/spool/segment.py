"""One file of the spool: rows in the order in which they were made, never changed after they are written.

A segment that was closed ends with an index of its rows, so that opening a large spool reads little; one that was
not (power loss, kill) is read as a whole. The same bytes can be held in memory instead while the disk takes none.
"""

from __future__ import annotations

import errno
import json
import os
import re
import struct
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from acqd.regular_file import open_regular
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool.record import (
    BEGUN,
    ENERGY,
    INDEX,
    OVERHEAD,
    REGISTERS,
    ROW,
    Energy,
    Stream,
    Window,
    begun_record,
    index_record,
    record_at,
    records,
)
from acqd.telemetry.topics import travels_alone
from acqd.uptime import Moment

_MAGIC, _END = b"ACQDSPL1", b"ACQDEND1"
_HEAD = struct.Struct("<8sQ")  # magic, UTC of creation [ns]
_TAIL = struct.Struct("<8sI")  # magic, offset of the index
START = _HEAD.size
"""Offset of the first record."""
_MODE = 0o640
_EXCHANGED = "another file of a spool is in its place"
_FIRST_RECORD = 256
"""Bytes that hold the first record, when the segment was begun."""
SUFFIX, KEPT, DAMAGED = ".seg", ".kept", ".damaged"
"""Rows that wait; rows that are stored, kept for a sink whose database was restored; what cannot be read."""
_NAME = re.compile(r"([0-9]{16,19})\.(?:seg|kept|damaged)")
_MOST_NUMBER = 10**19 - 10**9
"""Segments have smaller numbers. A foreign file of nines would make the next number too long for `_NAME`."""
_MOST_BYTES = 64 << 20
"""No spool writes a longer file; what somebody else has put there is not read into memory."""


def number_of(path: Path) -> int | None:
    """Number of the segment in a file; None for a file that no spool has written."""
    named = _NAME.fullmatch(path.name)
    return int(named[1]) if named and int(named[1]) < _MOST_NUMBER else None


class Segment:
    """Rows in one file (or in memory), and which of them still wait."""

    def __init__(self, number: int, path: Path | None) -> None:
        self.number, self.path = number, path
        self.size = START
        """Bytes up to the end of the last record."""
        self.pending: dict[Stream, Ranges] = {}
        self.energy: dict[str, Energy] = {}
        """Readings of each device's registers after its last row; "" as device in files of the time of one device."""
        self.registers: dict[str, Sequence[float]] = {}
        """State of each device's other registers then."""
        self.read_after: dict[str, Window] = {}
        """The window after which they were read."""
        self.unread: dict[Stream, tuple[int, bytes]] = {}
        """Number and payload of the last row of every stream that has no readings after it: a write was cut off."""
        self.begun: Moment | None = None
        """None in files that do not say it."""
        self.damaged = 0
        """Bytes that could not be read."""
        self.trouble = ""
        """Why the file cannot be read at present, else empty."""
        self.paused_until = 0.0
        """No attempt to read before this monotonic time [s]."""
        self._memory = bytearray()
        self._head = b""
        """Of the file, by which another one in its place is known; empty: never read."""
        self._file: int | None = None
        self._left: Path | None = None
        """What an attempt has left that failed: a disk that takes no bytes may not delete either."""

    @classmethod
    def create(cls, folder: Path | None, number: int, begun: Moment) -> Segment:
        """An empty segment; without `folder`, in memory. Raises OSError."""
        segment = cls(number, None)
        record = begun_record(begun)
        segment._head = _HEAD.pack(_MAGIC, time.time_ns())
        segment._memory += segment._head + record
        segment.begun, segment.size = begun, START + len(record)
        if folder is not None:
            segment.to_file(folder)
        return segment

    @classmethod
    def open(cls, path: Path) -> Segment:
        """The segment in a file, damage and a torn end skipped. Raises OSError."""
        number = number_of(path)
        assert number is not None
        segment = cls(number, path)
        file = open_regular(path, _MOST_BYTES)
        try:
            size = os.fstat(file).st_size
            segment._head = _read(file, START, 0)
            if segment._read_index(file, size):
                first = record_at(_read(file, min(_FIRST_RECORD, size - START), START), 0)
                segment.begun = first.begun if first is not None and first.kind == BEGUN else None
            else:
                data = _read(file, size, 0)
                segment.damaged = max(0, size - START - segment._index(data))
        finally:
            os.close(file)
        return segment

    def to_file(self, folder: Path) -> None:
        """Move what is in memory to a new file. Raises OSError and changes nothing."""
        path = folder / f"{self.number:016d}{SUFFIX}"
        new = os.O_TRUNC if path == self._left else os.O_EXCL
        file = os.open(path, os.O_RDWR | os.O_CREAT | new | os.O_CLOEXEC | os.O_APPEND, _MODE)
        try:
            _write(file, self._memory)
        except OSError:
            self._left = path
            with suppress(OSError):
                os.close(file)
            with suppress(OSError):
                path.unlink(missing_ok=True)
            raise
        self.path, self._file, self._memory = path, file, bytearray()

    def to_reserve(self, reserve: Path, memory: Sequence[Segment]) -> None:
        """Move what is in memory here and in the segments `memory` into blocks that the disk has set aside.

        The reserve becomes the file of this segment. Raises OSError and changes nothing.
        """
        content = self._memory + b"".join(bytes(other._memory[START:]) for other in memory)
        path = reserve.with_name(f"{self.number:016d}{SUFFIX}")
        file = os.open(reserve, os.O_RDWR | os.O_CLOEXEC)
        try:
            if len(content) > os.fstat(file).st_size:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            _write(file, content)
            os.ftruncate(file, len(content))
            os.fsync(file)
            reserve.rename(path)
        finally:
            os.close(file)
        self.path, self._memory = path, bytearray()
        self._index(bytes(content))

    @property
    def harm(self) -> Literal["", "gone", "resized"]:
        """What somebody has done to the file to which rows are appended; empty where the disk does not say.

        Gone: deleted, moved, or behind something that was mounted over its folder. The next start would not find it.
        """
        if self._file is None or self.path is None:
            return ""
        try:
            now = os.fstat(self._file)
            if now.st_nlink == 0:
                return "gone"
            there = os.stat(self.path)
            other = (there.st_dev, there.st_ino) != (now.st_dev, now.st_ino)  # or of a share that numbers files again
            if other and (there.st_size != now.st_size or self._is_exchanged()):
                return "gone"
        except FileNotFoundError:
            return "gone"
        except OSError:  # a share that is away: `append` meets that, too
            return ""
        return "" if now.st_size == self.size else "resized"

    def rescue(self) -> None:
        """Take the content of a file that is gone and still open back into memory. Raises OSError."""
        assert self._file is not None
        self._memory = bytearray(_read(self._file, self.size, 0))
        os.close(self._file)
        self._file = self.path = None

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
            json.dumps(
                {"streams": streams, "energy": self.energy, "registers": self.registers, "read_after": self.read_after}
            ).encode()
        )
        try:
            _write(self._file, index + _TAIL.pack(_END, self.size))
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._file, self.size)
        finally:
            self._release()

    def delete(self) -> None:
        """Remove the file. Raises OSError."""
        self._release()
        if self.path is not None and not self._is_exchanged():
            self.path.unlink(missing_ok=True)

    def rename(self, suffix: str) -> None:
        """Give the file another role. Raises OSError; FileNotFoundError where another file is in its place."""
        self._release()
        if self._is_exchanged():
            raise FileNotFoundError(errno.ENOENT, _EXCHANGED, str(self.path))
        if self.path is not None:
            self.path = self.path.rename(self.path.with_suffix(suffix))

    def read(self, offset: int, size: int) -> bytes:
        """At most `size` bytes of records. Raises OSError."""
        size = min(size, self.size - offset)
        if self.path is None:
            return bytes(self._memory[offset : offset + size])
        with self.path.open("rb", buffering=0) as file:
            if self._differs(_read(file.fileno(), START, 0)):
                raise OSError(errno.ESTALE, _EXCHANGED, str(self.path))
            return _read(file.fileno(), size, offset)

    def lose_unreadable(self) -> int:
        """Give up rows that damage has destroyed; how many. Raises OSError where the file cannot be read now."""
        kept = Segment(self.number, None)
        kept._index(self.read(0, self.size))
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

    def recall(self) -> None:
        """Every row of the segment waits again, after a restart, too: its index says what waited. Raises OSError."""
        whole = Segment(self.number, None)
        whole._index(self.read(0, self.size))
        self.pending = whole.pending
        if self._file is None and self.path is not None:
            file = os.open(self.path, os.O_WRONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
            try:
                os.ftruncate(file, self.size)
            finally:
                os.close(file)

    def _is_exchanged(self) -> bool:
        """Whether the file of another segment is at the path: under a folder that was moved, or mounted over.

        Raises OSError where the disk does not say.
        """
        if self.path is None or not self._head:
            return False
        try:
            with self.path.open("rb", buffering=0) as file:
                return self._differs(_read(file.fileno(), START, 0))
        except FileNotFoundError:
            return False

    def _differs(self, head: bytes) -> bool:
        """Whether a file with this head was begun by another one; a damaged head says nothing."""
        return bool(self._head) and head != self._head and head.startswith(_MAGIC) and len(head) == START

    def _release(self) -> None:
        if self._file is not None:
            with suppress(OSError):  # the file is closed all the same; what a share did not take, `confirm` says
                os.close(self._file)
            self._file = None

    def _index(self, data: bytes) -> int:
        """Note every intact record; their bytes together."""
        intact, before = 0, START
        for record in records(data, START):
            length = len(record.name) + len(record.body)
            if record.kind == ROW:
                stream = record.stream
                self.pending.setdefault(stream, Ranges()).add(record.seq, record.seq)
                self.unread[stream] = record.seq, record.payload
            elif record.kind == ENERGY:
                self._read_registers(record.device, record.energy)
            elif record.kind == REGISTERS:
                self.registers[record.device] = record.numbers
            elif record.kind == BEGUN:
                self.begun = record.begun
            intact += length + OVERHEAD
            before = record.end
        self.size = before
        return intact

    def _read_registers(self, device: str, energy: Energy) -> None:
        """Energy of a device, "": of the only one, after the rows that were just read."""
        self.energy[device] = energy
        rows = {stream: row for stream, row in self.unread.items() if device in ("", stream.device)}
        windows = [Window(of.boot, seq) for of, (seq, _) in rows.items() if not travels_alone(of.channel)]
        if windows:
            self.read_after[device] = windows[-1]
        for stream in rows:
            del self.unread[stream]

    def _read_index(self, file: int, size: int) -> bool:
        """Take the rows from the index at the end; False if it is missing or damaged."""
        if size < START + _TAIL.size:
            return False
        magic, offset = _TAIL.unpack(_read(file, _TAIL.size, size - _TAIL.size))
        record = record_at(_read(file, size - offset, offset), 0) if magic == _END and offset < size else None
        if record is None or record.kind != INDEX:
            return False
        content = json.loads(record.body)
        self.pending = {Stream(*names): Ranges(rows) for *names, rows in content["streams"]}
        self.energy = _energy(content["energy"])
        self.registers = content.get("registers", {})
        self.read_after = {device: Window(*window) for device, window in content.get("read_after", {}).items()}
        self.size = offset
        return True


def _energy(content: Any) -> dict[str, Energy]:
    """Registers by device in an index; registers of one device were a list."""
    devices = content if isinstance(content, dict) else {"": content or []}
    return {name: [(pair[0], pair[1]) for pair in pairs] for name, pairs in devices.items() if pairs}


def _read(file: int, size: int, offset: int) -> bytes:
    """`size` bytes from `offset` on, fewer only at the end of the file. Raises OSError."""
    data = os.pread(file, size, offset)
    while len(data) < size and (more := os.pread(file, size - len(data), offset + len(data))):
        data += more
    return data


def _write(file: int, data: bytes | bytearray) -> None:
    """All of `data`. Raises OSError, also where the disk takes only a part."""
    view = memoryview(data)
    try:
        while view:
            view = view[os.write(file, view) :]
    finally:
        view.release()  # a traceback may keep it, and nothing could be appended to `data` then
