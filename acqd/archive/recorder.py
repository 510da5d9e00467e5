"""One thread writes all segments of a daemon: what the disk does never reaches the metering.

Tracks hand blocks over and go on. What the thread cannot take, because the disk is slow, full or broken, is counted and
becomes a named gap: the next segment says why it begins.
"""

from __future__ import annotations

import errno
import logging
import os
import queue
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from acqd.archive.head import Head, Origin
from acqd.archive.ring import Limits, Ring, lock
from acqd.archive.segment_file import STOPPED, SegmentFile, name_of
from acqd.archive.track import Sheet, Track
from acqd.changes import StateLog
from acqd.errors import UserError
from acqd.metering.block import SampleBlock

_log = logging.getLogger(__name__)
SEGMENT_S, CHUNK_S = 300.0, 0.4
"""s of samples in a file, and in a record: what is not in a whole record is lost when acqd is killed."""
_SYNC_S = 0.3
"""With a record's length and the time to write it, the power takes less than a second."""
_MOST_WAITING = 32 * 2**20
"""Bytes of samples that wait for the disk: two minutes of one box."""
_RETRY_S = 1.0
_OPENING_S = 2.0
"""How long a start waits for the files that are there; metering begins without them then."""


@dataclass(frozen=True, slots=True)
class Now:
    """What an archive says about itself; for any thread."""

    folder: str
    bytes: int
    limit_bytes: int
    files: int
    seconds: float
    """Of samples of the device that has most."""
    lost: int
    """Samples (of all channels) since the start that the archive could not take."""
    deleted: int
    """Segments since the start that made room."""
    trouble: str
    """Why samples are not kept at present, else empty."""


_Order = Callable[[], None]


class Recorder:
    """The archive of one daemon."""

    def __init__(self, root: Path, limits: Limits, *, segment_s: float = SEGMENT_S, chunk_s: float = CHUNK_S) -> None:
        """Raises UserError when another process writes to this folder.

        A folder that cannot be used now is tried again: it does not keep the daemon from metering.
        """
        self._root, self._limits = root, limits
        self.segment_s, self.chunk_s = segment_s, chunk_s
        self._lock: int | None = None
        self._says = StateLog(_log)
        self._trouble, self._retry_at, self._lost = "", 0.0, 0
        try:
            self._lock = lock(root)
        except BlockingIOError:
            raise UserError(f"archive {root} is in use by another acqd; give this one another folder") from None
        except OSError as error:
            self._note_trouble("disk", error.strerror or str(error))
        self._ring = Ring(root, limits)
        self._number = 0
        self._opened = threading.Event()
        self._orders: queue.SimpleQueue[tuple[_Order, int] | None] = queue.SimpleQueue()
        self._waiting, self._counting = 0, threading.Lock()
        self._open: dict[int, tuple[Sheet, SegmentFile]] = {}
        self._latest = self._snapshot()
        self._thread = threading.Thread(target=self._run, name="archive", daemon=True)
        self._thread.start()
        if self._lock is not None:
            self._opened.wait(_OPENING_S)

    @property
    def waiting(self) -> int:
        """Bytes of samples that are not on disk yet."""
        return self._waiting

    @property
    def behind(self) -> bool:
        """Whether so much waits that no segment should be begun."""
        return self._waiting >= _MOST_WAITING // 2

    @property
    def ready(self) -> bool:
        """Whether a segment can be begun: the disk works, or it is time to try it again, and not too much waits."""
        return self._opened.is_set() and not self.behind and time.monotonic() >= self._retry_at

    @property
    def latest(self) -> Now:
        """For any thread; at most a second old, unless the disk hangs."""
        return replace(self._latest, lost=self._lost, trouble=self._trouble)

    def track(self, origin: Origin, now: Callable[[], tuple[str, dict[str, Any]]]) -> Track:
        """Takes the samples of one stream. `now` gives the boot of the rows and the state that meters them."""
        return Track(self, origin, now)

    def begin(self, head: Head, state: dict[str, Any]) -> Sheet:
        """Have a segment begun."""
        sheet = Sheet(head, name_of(head.number, head.utc_ns))
        self._put(lambda: self._begin(sheet, state))
        return sheet

    def append(self, sheet: Sheet, blocks: Sequence[SampleBlock]) -> bool:
        """Have blocks written; False when too much waits."""
        size = sum(block.codes.nbytes for block in blocks)
        if self._waiting + size > _MOST_WAITING:
            return False
        self._put(lambda: self._append(sheet, blocks), size)
        return True

    def end(self, sheet: Sheet, why: str) -> None:
        """Have a segment ended."""
        self._put(lambda: self._end(sheet, why))

    def next_number(self) -> int:
        """Of the next segment."""
        number, self._number = self._number, self._number + 1
        return number

    def lose(self, samples: int, why: str = "") -> None:
        """Count samples that are not kept."""
        with self._counting:
            self._lost += samples
        if why:
            self._note_trouble("behind", why)

    def close(self, timeout: float = 1.0) -> None:
        """Write what waits, for `timeout` [s] at most."""
        self._orders.put(None)
        self._thread.join(timeout)
        if self._thread.is_alive():
            _log.error("archive: the disk is slow; %d bytes of samples are not written", self._waiting)
        elif self._lock is not None:
            os.close(self._lock)

    def _put(self, order: _Order, size: int = 0) -> None:
        with self._counting:
            self._waiting += size
        self._orders.put((order, size))

    # -- in the thread --

    def _run(self) -> None:
        synced = time.monotonic()
        while True:
            if not self._opened.is_set() and time.monotonic() >= self._retry_at:
                self._open_ring()
            try:
                item = self._orders.get(timeout=_SYNC_S)
            except queue.Empty:
                item = (lambda: None, 0)
            if item is None:
                break
            order, size = item
            try:
                order()
            except Exception:  # a bug here costs samples of the archive, and no row
                _log.exception("archive: the thread that writes it goes on after a bug")
            with self._counting:
                self._waiting -= size
            if time.monotonic() - synced >= _SYNC_S:
                self._sync()
                synced = time.monotonic()
                self._latest = self._snapshot()
        for number in list(self._open):
            self._close(number, STOPPED)
        self._latest = self._snapshot()

    def _open_ring(self) -> None:
        """Look what is there, and end what a crash has left open; a disk that is away is tried again."""
        try:
            self._lock = self._lock if self._lock is not None else lock(self._root)
            self._ring.open()
        except OSError as error:
            self._note_trouble("disk", error.strerror or str(error))
            return
        self._number = self._ring.next_number
        self._opened.set()

    def _begin(self, sheet: Sheet, state: dict[str, Any]) -> None:
        head, folder = sheet.head, self._root / sheet.head.origin.device

        def write() -> None:
            self._ring.expire()
            self._ring.make_room(0)
            file = SegmentFile(folder, sheet.name, head, state)
            self._open[head.number] = sheet, file
            self._ring.add(head.number, file.path)

        self._try(sheet, write)

    def _append(self, sheet: Sheet, blocks: Sequence[SampleBlock]) -> None:
        _, file = self._open.get(sheet.head.number, (sheet, None))
        if file is None:
            self.lose(sum(len(block.codes) for block in blocks))
            return

        def write() -> None:
            self._ring.make_room(0)
            file.append(blocks)
            self._ring.update(sheet.head.number, file.size, file.seconds)

        if not self._try(sheet, write):
            self.lose(sum(len(block.codes) for block in blocks))

    def _end(self, sheet: Sheet, why: str) -> None:
        self._close(sheet.head.number, why)

    def _close(self, number: int, why: str) -> None:
        _, file = self._open.pop(number, (None, None))
        if file is not None:
            file.close(why)
            self._ring.update(number, file.size, file.seconds, writing=False)

    def _try(self, sheet: Sheet, write: Callable[[], None]) -> bool:
        """Write; a full disk gives up its oldest segments first. What fails ends the segment, not acqd."""
        while True:
            try:
                write()
            except OSError as error:
                if error.errno in (errno.ENOSPC, errno.EDQUOT) and self._ring.give_up_oldest():
                    continue
                self._fail(sheet, error.strerror or str(error))
                return False
            except Exception as error:  # a bug here costs samples of the archive, and no row
                _log.exception("archive: a segment could not be written")
                self._fail(sheet, repr(error))
                return False
            return True

    def _fail(self, sheet: Sheet, reason: str) -> None:
        sheet.failed = reason
        self._close(sheet.head.number, f"disk: {reason}")
        with suppress(OSError):
            self._ring.make_room(0)  # what has just ended may go, too: the next segment may be a long time away
        self._note_trouble("disk", reason)

    def _note_trouble(self, state: str, reason: str) -> None:
        self._trouble, self._retry_at = reason, time.monotonic() + _RETRY_S
        self._says.trouble("archive", state, f"samples are not kept: {reason}; rows go on", logging.ERROR)

    def _sync(self) -> None:
        for sheet, file in list(self._open.values()):
            try:
                file.sync()
            except OSError as error:
                self._fail(sheet, error.strerror or str(error))
        if self._open and self.ready:
            self._trouble = ""
            self._says.fine("archive", "samples are kept again")

    def _snapshot(self) -> Now:
        ring = self._ring
        return Now(
            str(self._root), ring.size, self._limits.most_bytes, ring.files, round(ring.seconds, 1), self._lost,
            ring.deleted, self._trouble,
        )  # fmt: skip
