"""The segments of a spool in order: on disk, or in memory while the disk takes nothing."""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

from acqd.errors import UserError
from acqd.retry import Backoff
from acqd.telemetry.spool.kept import KeptSegments
from acqd.telemetry.spool.reserve import Reserve
from acqd.telemetry.spool.segment import DAMAGED, KEPT, SUFFIX, Segment, number_of
from acqd.uptime import Moment

_log = logging.getLogger(__name__)
_DISK_RETRY_S = 1.0
_FULL = (errno.ENOSPC, errno.EDQUOT)
"""Kept segments make room then. After any other error they stay: a database may be put back later."""
_OPENING_S = 2.0
"""How long a start waits for segments that cannot be read yet; metering begins without them then."""
_DAMAGED_SHARE = 16
"""Files that cannot be read any more take this fraction of the spool at most."""


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
    """Appends to the newest segment; older ones are only read and deleted. For one thread.

    A file is deleted when no row of it waits, or when the limit in bytes says so (ADR 29). What cannot be read stays:
    it is tried again, or put aside where its bytes are damaged.
    """

    def __init__(
        self,
        folder: Path | None,
        segment_bytes: int,
        now: Callable[[], Moment],
        *,
        most_bytes: int,
        reserve_bytes: int = 0,
        keep_s: float = 0.0,
    ) -> None:
        """Without `folder`, everything is in memory. Raises UserError when the folder cannot be used.

        `reserve_bytes` are set aside on the disk for what is in memory when the daemon stops while the disk is full.
        Delivered segments are kept for `keep_s`, as far as `most_bytes` leave room.
        """
        self._folder, self._segment_bytes, self._now = folder, segment_bytes, now
        self._most = most_bytes
        self._reserve = Reserve(folder / "reserve", reserve_bytes) if folder is not None and reserve_bytes else None
        self.segments: list[Segment] = []
        self.newest: Segment | None = None
        """Where rows are appended; None before the first."""
        self.bytes = 0
        self.trouble = ""
        """Why the disk takes no rows, else empty."""
        self.deleted = 0
        """How often somebody has deleted the newest file, or the folder."""
        self.unopened: list[Path] = []
        """Segments that could not be read at the start."""
        self.unrecalled: list[Segment] = []
        """Segments that could not be read when their rows were wanted again."""
        self._full = False
        self._kept = KeptSegments(keep_s)
        self._retry_at = 0.0
        self._dirty: set[Path] = set()
        self._lock: int | None = None
        self.next_number = 1
        if folder is not None:
            self._open(folder)

    def append(self, data: bytes) -> Segment:
        """Write whole records; the segment that holds them. Never fails: memory holds what the disk refuses."""
        if self.trouble and time.monotonic() >= self._retry_at:
            self.to_disk()
        newest = self.newest
        harm = newest.harm if newest is not None and not self.trouble else ""
        if newest is not None and harm == "gone":
            self._rescue(newest)
        elif newest is not None and harm == "resized":
            self._leave(newest)
            newest = None
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
        self._forget(segment)
        self._kept.delete(segment)

    def delete_if_done(self, segment: Segment) -> None:
        """Remove a segment of which no row waits; the newest one stays, for it holds the energy registers."""
        if segment.pending or segment is self.newest or segment in self.unrecalled:
            return
        if segment.damaged:
            self._put_aside(segment)
        else:
            self._forget(segment)
            if self._full or not self._kept.add(segment):
                self._kept.delete(segment)
            self.expire()

    def expire(self) -> None:
        """Delete kept segments that are past their time, or take bytes that rows that wait have."""
        self._kept.expire(self._most - self.bytes)

    def recall(self) -> None:
        """All rows of segments that are still there wait again, delivered ones too."""
        for segment in self._kept.take_back():
            self.segments.append(segment)
            self.bytes += segment.size
        self.segments.sort(key=lambda segment: segment.number)
        self.unrecalled = list(self.segments)
        self.recall_more()

    def recall_more(self) -> bool:
        """Try again what could not be read then; whether rows of such a segment wait now."""
        segments, self.unrecalled = self.unrecalled, []
        for segment in segments:
            try:
                segment.recall()
            except OSError as error:
                if isinstance(error, FileNotFoundError) and segment is not self.newest:
                    continue  # a person has deleted it
                if not segment.trouble:
                    _log.error("spool: %s cannot be read: %s; trying again", segment.path, error.strerror)
                segment.trouble = f"{segment.path} cannot be read: {error.strerror or error}"
                self.unrecalled.append(segment)
            else:
                segment.trouble = ""
        return len(self.unrecalled) < len(segments)

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
                self._to_file(segment)
            except OSError as error:
                self._note_trouble(error)
                return
            if segment is not self.newest:
                segment.close()
        self.trouble, self._full = "", False
        _log.warning("spool: the disk takes rows again")
        self._keep_reserve()

    def open_more(self) -> list[Segment]:
        """Segments that could not be read at the start and can be now."""
        paths, self.unopened, opened = self.unopened, [], []
        for path in paths:
            try:
                opened.append(Segment.open(path))
            except OSError:
                self.unopened.append(path)
        self.segments = sorted([*self.segments, *opened], key=lambda segment: segment.number)
        self.bytes += sum(segment.size for segment in opened)
        return opened

    def unconfirmed(self) -> set[Path]:
        """Files and folders that have changed since the last call."""
        dirty, self._dirty = self._dirty, set()
        return dirty

    def close(self) -> None:
        """Write the index of the newest segment and release the folder. Raises OSError."""
        if self.newest is not None and self.newest.harm == "gone":
            self._rescue(self.newest)
        if self._folder is not None and self.in_memory():
            self.to_disk()
        if self.trouble:
            self._to_reserve()
        if self.newest is not None:
            self.newest.close()
        confirm(self.unconfirmed())
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _open(self, folder: Path) -> None:
        try:
            self._take_folder(folder)
            paths = {}
            for path in sorted(folder.iterdir()):
                number = number_of(path)
                if number is not None and not path.is_dir():
                    paths[path] = number
                elif path.suffix == SUFFIX:
                    _log.warning("spool: %s is no file of this spool, and is left alone", path)
        except BlockingIOError:
            raise UserError(f"spool {folder} is in use by another acqd; give this one another state_dir") from None
        except OSError as error:
            raise UserError(f"spool {folder}: {error.strerror}; check state_dir and its owner") from None
        self.next_number = max(paths.values(), default=0) + 1
        self.unopened = [path for path in paths if path.suffix == SUFFIX]
        for path in [path for path in paths if path.suffix == KEPT]:
            self._kept.adopt(path, paths[path])
        backoff, ends = Backoff(), time.monotonic() + _OPENING_S
        self.open_more()
        while self.unopened and (pause := backoff.pause_s()) < ends - time.monotonic():
            time.sleep(pause)
            self.open_more()
        for path in self.unopened:
            _log.error("spool: %s cannot be read; its rows wait until it can", path)
        if self._reserve is not None:
            self._reserve.make()

    def _take_folder(self, folder: Path) -> None:
        """Make the folder where it is missing, and lock it. Raises OSError; BlockingIOError: another acqd has it."""
        folder.mkdir(parents=True, exist_ok=True, mode=0o750)
        if self._has_taken(folder):
            return
        try:
            lock = os.open(folder / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
        except OSError as error:
            if error.errno != errno.EROFS:
                raise
            lock = os.open(folder / "lock", os.O_RDONLY | os.O_CLOEXEC)  # what is there can be sent
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            raise
        if self._lock is not None:
            os.close(self._lock)
        self._lock = lock

    def _has_taken(self, folder: Path) -> bool:
        """Whether the lock of this very folder is held already: asked once more, it would look like another acqd's."""
        try:
            return self._lock is not None and os.path.samestat(os.fstat(self._lock), os.stat(folder / "lock"))
        except FileNotFoundError:
            return False

    def _keep_reserve(self) -> None:
        """After the rows: a person may have deleted the reserve, or the disk was too full for it at the start."""
        if self._reserve is not None:
            self._reserve.keep()

    def _to_reserve(self) -> None:
        """Write what is in memory into the blocks that were set aside."""
        memory = [segment for segment in self.segments if segment.path is None]
        if self._reserve is None or not memory:
            return
        first, *others = memory
        try:
            first.to_reserve(self._reserve.path, others)
        except OSError as error:
            _log.error("spool: %s cannot be used either: %s", self._reserve.path, error.strerror)
            return
        self.segments = [segment for segment in self.segments if segment not in others]
        self.newest, self.trouble, self._full = first, "", False
        _log.warning("spool: the disk is full; the rows in memory are in the blocks that were set aside for that")

    @property
    def _on_disk(self) -> bool:
        return self._folder is not None and not self.trouble

    def _to_file(self, segment: Segment) -> None:
        """Move a segment to its file; a folder that is gone is made again. Raises OSError."""
        assert self._folder is not None
        try:
            segment.to_file(self._folder)
        except FileNotFoundError:
            self._take_folder(self._folder)
            self.deleted += 1
            _log.error("spool: the folder %s was deleted or moved, and is made again", self._folder)
            segment.to_file(self._folder)
        except FileExistsError:  # another folder is in the place of the first one, or somebody's file in this one
            self._take_folder(self._folder)
            self._number_behind(segment)
            segment.to_file(self._folder)
        assert segment.path is not None
        self._dirty |= {segment.path, self._folder}

    def _number_behind(self, segment: Segment) -> None:
        """What is in memory, and `segment`, get numbers behind those of the files of the folder. Raises OSError."""
        assert self._folder is not None
        files = [number for path in self._folder.iterdir() if (number := number_of(path)) is not None]
        self.next_number = max([self.next_number, *[number + 1 for number in files]])
        memory = [one for one in self.segments if one.path is None and one is not segment]
        for one in sorted([*memory, segment], key=lambda one: one.number):
            one.number = self.next_number
            self.next_number += 1

    def _rescue(self, newest: Segment) -> None:
        """Write the rows of a file that is gone into a new one of the same name."""
        path, before = newest.path, self.deleted
        try:
            newest.rescue()
            self._to_file(newest)
        except OSError as error:
            self._note_trouble(error)
        else:
            self._keep_reserve()
        self.deleted = before + 1  # the folder with it is the same deed
        _log.error("spool: somebody has deleted or moved %s; its %d bytes are written again", path, newest.size)

    def _leave(self, newest: Segment) -> None:
        """Rows that follow what somebody has cut off or written into a file would not be found: they go elsewhere."""
        self.deleted += 1
        _log.error(
            "spool: somebody has changed %s, which had %d bytes; rows go into another file", newest.path, newest.size
        )

    def _rotate(self) -> Segment:
        """Begin another segment and close the one before."""
        before, number = self.newest, self.next_number
        segment = Segment.create(None, number, self._now())
        if self._on_disk:
            try:
                self._to_file(segment)
            except OSError as error:
                self._note_trouble(error)
            else:
                self._keep_reserve()
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
        self._full = error.errno in _FULL
        if self._full:
            self._kept.clear()

    def _forget(self, segment: Segment) -> None:
        if segment is self.newest:
            self.newest = None
        self.segments.remove(segment)
        if segment in self.unrecalled:
            self.unrecalled.remove(segment)
        self.bytes -= segment.size

    def _put_aside(self, segment: Segment) -> None:
        """Keep a damaged file for a person, apart from the rows that wait; the oldest ones go when they are many."""
        self._forget(segment)
        try:
            segment.rename(DAMAGED)
            if segment.path is None:
                return
            files = sorted(segment.path.parent.glob(f"*{DAMAGED}"))
            while len(files) > 1 and sum(file.stat().st_size for file in files) > self._most // _DAMAGED_SHARE:
                files.pop(0).unlink()
        except OSError as error:
            _log.error("spool: %s cannot be put aside: %s", segment.path, error.strerror)
            return
        _log.warning("spool: the damaged file is kept as %s", segment.path)
