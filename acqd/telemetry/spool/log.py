"""The segments of a spool in order: on disk, or in memory while the disk takes nothing."""

from __future__ import annotations

import fcntl
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

from acqd.errors import UserError
from acqd.telemetry.spool.segment import Segment

_log = logging.getLogger(__name__)
_DISK_RETRY_S = 1.0


def confirm(paths: set[Path]) -> None:
    """Wait until the disk has the content of files and folders; a disk may take its time. Raises OSError."""
    for path in paths:
        try:
            file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except FileNotFoundError:
            continue  # delivered meanwhile
        try:
            (os.fsync if path.is_dir() else os.fdatasync)(file)
        finally:
            os.close(file)


class SegmentLog:
    """Appends to the newest segment; older ones are only read and deleted. For one thread."""

    def __init__(self, folder: Path | None, segment_bytes: int, now_ns: Callable[[], int]) -> None:
        """Without `folder`, everything is in memory. Raises UserError when the folder cannot be used."""
        self._folder, self._segment_bytes, self._now_ns = folder, segment_bytes, now_ns
        self.segments: list[Segment] = []
        self.newest: Segment | None = None
        """Where rows are appended; None before the first."""
        self.bytes = 0
        self.trouble = ""
        """Why the disk takes no rows, else empty."""
        self._retry_at = 0.0
        self._dirty: set[Path] = set()
        self._lock: int | None = None
        if folder is not None:
            self._open(folder)
        self.next_number = self.segments[-1].number + 1 if self.segments else 1

    def append(self, data: bytes) -> Segment:
        """Write whole records; the segment that holds them. Never fails: memory holds what the disk refuses."""
        if self.trouble and time.monotonic() >= self._retry_at:
            self.to_disk()
        newest = self.newest
        if newest is None or newest.size + len(data) > self._segment_bytes or (newest.path is None and self._on_disk):
            newest = self._rotate()
        try:
            newest.append(data)
        except OSError as error:
            self._note_trouble(error)
            newest = self._rotate()
            newest.append(data)
        self.bytes += len(data)
        if newest.path is not None:
            self._dirty.add(newest.path)
        return newest

    def delete(self, segment: Segment) -> None:
        """Remove a segment."""
        if segment is self.newest:
            self.newest = None
        self.segments.remove(segment)
        self.bytes -= segment.size
        try:
            segment.delete()
        except OSError as error:
            _log.error("spool: %s cannot be deleted: %s", segment.path, error.strerror)

    def delete_if_done(self, segment: Segment) -> None:
        """Remove a segment of which no row waits; the newest one stays, for it holds the energy registers."""
        if not segment.pending and segment is not self.newest:
            self.delete(segment)

    def in_memory(self) -> int:
        """Bytes that are not on disk."""
        return sum(segment.size for segment in self.segments if segment.path is None)

    def to_disk(self) -> None:
        """Move segments from memory to the disk, oldest first, as far as the disk takes them."""
        assert self._folder is not None
        for segment in self.segments:
            if segment.path is not None:
                continue
            try:
                segment.to_file(self._folder)
            except OSError as error:
                self._note_trouble(error)
                return
            assert segment.path is not None
            self._dirty |= {segment.path, self._folder}
            if segment is not self.newest:
                segment.close()
        self.trouble = ""
        _log.warning("spool: the disk takes rows again")

    def unconfirmed(self) -> set[Path]:
        """Files and folders that have changed since the last call."""
        dirty, self._dirty = self._dirty, set()
        return dirty

    def close(self) -> None:
        """Write the index of the newest segment and release the folder. Raises OSError."""
        if self.trouble:
            self.to_disk()
        if self.newest is not None:
            self.newest.close()
        confirm(self.unconfirmed())
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _open(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o750)
            self._lock = os.open(folder / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for path in sorted(folder.glob("[0-9]*.seg")):
                segment = Segment.open(path)
                self.segments.append(segment)
                self.bytes += segment.size
        except BlockingIOError:
            raise UserError(f"spool {folder} is in use by another acqd; give this one another state_dir") from None
        except OSError as error:
            raise UserError(f"spool {folder}: {error.strerror}; check state_dir and its owner") from None

    @property
    def _on_disk(self) -> bool:
        return self._folder is not None and not self.trouble

    def _rotate(self) -> Segment:
        """Begin another segment and close the one before."""
        before, number = self.newest, self.next_number
        folder = self._folder if self._on_disk else None
        try:
            segment = Segment.create(folder, number, self._now_ns())
        except OSError as error:
            self._note_trouble(error)
            segment = Segment.create(None, number, self._now_ns())
        if segment.path is not None and self._folder is not None:
            self._dirty.add(self._folder)
        self.next_number += 1
        self.newest = segment
        self.segments.append(segment)
        self.bytes += segment.size
        if before is not None:
            before.close()
        return segment

    def _note_trouble(self, error: OSError) -> None:
        if not self.trouble:
            _log.error("spool: the disk takes no rows (%s); they wait in memory, metering goes on", error.strerror)
        self.trouble = error.strerror or str(error)
        self._retry_at = time.monotonic() + _DISK_RETRY_S
