"""The spool: rows in order, kept until they are delivered, dropped only by the policy when it is full (ADR 29).

`append` writes a window with one call, so that a killed process loses no row that it has appended. To `confirm` what is
`unconfirmed`, once a second in another thread, makes the rows safe from power loss. Memory grows with the number of
segments, not of rows.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

from acqd.retry import Backoff
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool.log import SegmentLog
from acqd.telemetry.spool.reading import read_rows
from acqd.telemetry.spool.recalls import Recalls
from acqd.telemetry.spool.record import Readings, Stream, Window, energy_record, registers_record, row_record
from acqd.telemetry.spool.segment import START, Segment
from acqd.uptime import Moment, moment

_log = logging.getLogger(__name__)
_SEGMENT = 1 << 20
_PARTS = 16  # a spool has at least so many segments, so that dropping one costs little
_MEMORY = 32 << 20  # bytes of a spool without a folder at most
_ALERT, _CALM = 0.9, 0.8
WhenFull = Literal["drop-oldest", "drop-newest"]


class SpooledRow(NamedTuple):
    """One row: its stream, its number and its MQTT payload."""

    stream: Stream
    seq: int
    payload: bytes


class Position(NamedTuple):
    """A place in the spool: number of the segment and offset in it."""

    segment: int
    offset: int


@dataclass(frozen=True, slots=True)
class Limits:
    """When the spool is full, and what goes then."""

    max_bytes: int = 1_000_000_000
    max_age_s: float = 30 * 86_400.0
    """From which age on rows that wait are a problem that somebody has to know of; no row goes for its age."""
    when_full: WhenFull = "drop-oldest"
    memory_bytes: int = 4 << 20
    """What waits in memory while the disk takes nothing."""
    keep_s: float = 0.0
    """How long delivered rows are kept for a sink whose database is put back to an earlier state."""


class Spool:
    """Rows that wait; for one thread."""

    def __init__(self, folder: Path | None, limits: Limits | None = None, now: Callable[[], Moment] = moment) -> None:
        """Without `folder`, rows wait in memory. Raises UserError when the folder cannot be used."""
        self.limits = limits or Limits()
        self.max_bytes = self.limits.max_bytes if folder else min(self.limits.max_bytes, _MEMORY)
        self._folder, self._now = folder, now
        segment_bytes = max(4096, min(_SEGMENT, self.max_bytes // _PARTS))
        self._most = self.max_bytes - segment_bytes  # the newest segment will grow
        self._log = SegmentLog(
            folder,
            segment_bytes,
            now,
            most_bytes=self._most,
            reserve_bytes=min(self.limits.memory_bytes, self.max_bytes) + 2 * segment_bytes,
            keep_s=self.limits.keep_s,
        )
        self._recalls = Recalls(folder)
        self.unconfirmed = self._log.unconfirmed
        self.accepted = self.dropped = self.damaged_bytes = 0
        self._readings: dict[str, Readings] = {}
        self._unread: dict[Stream, SpooledRow] = {}
        self._alerted = self._old = self._dropping = self._unreadable = False
        self._names: dict[Stream, bytes] = {}
        self._backoff, self._look_again = Backoff(), False
        self._open_at = 0.0
        for segment in self._log.segments:
            self._adopt(segment)
        if waiting := len(self):
            _log.info("spool: %d rows of an earlier start wait in %s", waiting, folder)

    def append(self, rows: Sequence[SpooledRow], readings: Readings | None = None) -> bool:
        """Keep the rows of a window and the registers of their device after it.

        False when the spool is full and refuses the newest.
        """
        self.accepted += len(rows)
        data = b"".join([row_record(self._name(row.stream), row.seq, row.payload) for row in rows])
        device = rows[0].stream.device if readings is not None and rows else None
        if device is not None and readings is not None:
            data += energy_record(device, readings.energy)
            if readings.registers is not None:
                data += registers_record(device, readings.registers)
            window = Window(rows[-1].stream.boot, rows[-1].seq)
            self._readings[device] = readings._replace(after=window)
        if self.limits.when_full == "drop-newest" and self.size + len(data) > self._most:
            self._lost(len(rows), "refusing the newest rows")
            return False
        before, segment = self._log.newest, self._log.append(data)
        for stream, seq, _ in rows:
            waiting = segment.pending.get(stream)
            if waiting is None:
                waiting = segment.pending[stream] = Ranges()
            waiting.add(seq, seq)
        if device is not None and readings is not None:
            segment.energy[device] = readings.energy
            segment.read_after[device] = window
            if readings.registers is not None:
                segment.registers[device] = readings.registers
        if segment is not before:
            for older in self._log.segments[:-1]:
                self._log.delete_if_done(older)
            self._limit()
        return True

    def readings(self, device: str) -> Readings | None:
        """Readings of a device's registers after its last row, also of an earlier start.

        "" as device: those of a spool that was written when a daemon had one device.
        """
        return self._readings.get(device)

    def unread(self, device: str) -> list[SpooledRow]:
        """The last row of every stream of a device that an earlier start has spooled after its last readings.

        A power cut may leave the rows of a window without the readings that follow them, and so may a kill.
        """
        return [row for row in self._unread.values() if row.stream.device == device]

    def remove(self, stream: Stream, first: int, last: int) -> int:
        """Rows first..last are delivered: forget them, those of copies of a file, too; how many waited."""
        removed = 0
        for segment in list(self._log.segments):
            waiting = segment.pending.get(stream)
            if waiting is None:
                continue
            removed += waiting.remove(first, last)
            if not waiting:
                del segment.pending[stream]
                self._log.delete_if_done(segment)
        return removed

    def read(
        self, position: Position, most: int, wanted: Callable[[Stream, int], bool]
    ) -> tuple[list[SpooledRow], Position]:
        """The next rows that wait and are `wanted`, and the position after them; fewer while there is much to skip."""
        now = time.monotonic()
        rows, segment, offset, damaged, failed = read_rows(
            self._log.segments, *position, most, wanted, lambda segment: segment.paused_until <= now
        )
        for bad in damaged:
            self._lose(bad)
        for away, error in failed:
            self._pause(away, error)
        if self._unreadable and not self.reading_trouble:
            self._unreadable = False
            self._backoff.reset()
            _log.warning("spool: all rows can be read again")
        return [SpooledRow(*row) for row in rows], Position(segment, offset)

    def readable_again(self) -> bool:
        """Whether rows that the disk did not give out are to be tried again: read from the start then."""
        now = time.monotonic()
        if (self._log.unopened or self._log.unrecalled) and now >= self._open_at:
            self._open_at = now + self._backoff.pause_s()
            if self._log.unrecalled and self._log.recall_more():
                self._look_again = True
                self._backoff.reset()
            for segment in self._log.open_more():
                _log.warning("spool: %s can be read; its rows are sent", segment.path)
                self._adopt(segment, behind=True)
                self._look_again = True
        if self._look_again and all(segment.paused_until <= now for segment in self._log.segments):
            self._look_again = False
            return True
        return False

    def recall(self, sink: str = "", event: str = "") -> int:
        """Rows that are delivered and still kept wait again, for a sink that has lost them; how many.

        Where the sink names the event, once for it, also across starts.
        """
        if event and not self._recalls.note(sink, event):
            return 0
        before = len(self)
        self._log.recall()
        return len(self) - before

    def close(self) -> int:
        """Write everything to the disk and release the folder; how many rows could not be written.

        Raises OSError.
        """
        try:
            self._log.close()
        finally:
            in_memory = [segment for segment in self._log.segments if segment.path is None]
        return sum(len(rows) for segment in in_memory for rows in segment.pending.values())

    @property
    def start(self) -> Position:
        """Before the oldest row."""
        segments = self._log.segments
        return Position(segments[0].number, START) if segments else self.end

    @property
    def end(self) -> Position:
        """After the newest row."""
        newest = self._log.segments[-1] if self._log.segments else None
        return Position(newest.number, newest.size) if newest else Position(self._log.next_number, START)

    def __len__(self) -> int:
        """Rows that wait."""
        return sum(len(rows) for segment in self._log.segments for rows in segment.pending.values())

    @property
    def size(self) -> int:
        """Bytes."""
        return self._log.bytes

    @property
    def segments(self) -> int:
        """Number of segments."""
        return len(self._log.segments)

    @property
    def trouble(self) -> str:
        """Why the disk takes no rows, else empty."""
        return self._log.trouble

    @property
    def deleted(self) -> int:
        """How often somebody has deleted the newest file, or the folder, while the daemon ran."""
        return self._log.deleted

    @property
    def reading_trouble(self) -> str:
        """Why rows that wait cannot be read now, else empty."""
        if self._log.unopened:
            return f"{len(self._log.unopened)} files of an earlier start cannot be opened"
        waiting = (segment for segment in self._log.segments if segment.pending or segment in self._log.unrecalled)
        return next((segment.trouble for segment in waiting if segment.trouble), "")

    @property
    def age_s(self) -> float:
        """Age of the oldest segment with a row that waits [s]; since the computer's start at least."""
        oldest = next((segment for segment in self._log.segments if segment.pending), None)
        if oldest is None or oldest.begun is None:
            return 0.0
        return oldest.begun.age_s(self._now())

    @property
    def devices(self) -> set[str]:
        """Devices of the rows that wait."""
        return {stream.device for segment in self._log.segments for stream in segment.pending}

    def _adopt(self, segment: Segment, *, behind: bool = False) -> None:
        """Take over a segment of an earlier start; `behind`: rows of this start have newer readings."""
        if segment.damaged:
            self.damaged_bytes += segment.damaged
            _log.warning("spool: %s was torn: %d bytes left out", segment.path, segment.damaged)
        if behind:
            return
        for device, energy in segment.energy.items():
            self._readings[device] = Readings(energy, segment.registers.get(device), segment.read_after.get(device))
            for stream in [stream for stream in self._unread if device in ("", stream.device)]:
                del self._unread[stream]
        self._unread |= {stream: SpooledRow(stream, *row) for stream, row in segment.unread.items()}
        segment.unread.clear()

    def _limit(self) -> None:
        """Drop the oldest segments while there is too much, or too much in memory."""
        log = self._log
        oldest, drops = log.segments[0], self.limits.when_full == "drop-oldest"
        while oldest is not log.newest and drops and self.size > self._most:
            self._drop(oldest)
            oldest = log.segments[0]
        if log.trouble and log.in_memory() > self.limits.memory_bytes and oldest is not log.newest:
            self._drop(oldest)  # its room may be enough
            log.to_disk()
            in_memory = [segment for segment in log.segments if segment.path is None]
            if log.trouble and len(in_memory) > 1 and log.in_memory() > self.limits.memory_bytes:
                self._drop(in_memory[0])
        log.expire()
        self._warn()

    def _warn(self) -> None:
        """Say when the spool fills, and when its rows become old."""
        share, old = self.size / self._most, self.age_s > self.limits.max_age_s
        if share >= _ALERT and not self._alerted:
            self._alerted = True
            _log.warning("spool: %d %% full; when it is full: %s", 100 * share, self.limits.when_full)
        elif share < _CALM and self._alerted:
            self._alerted = self._dropping = False
            _log.info("spool: below %d %% again; %d rows were dropped in all", 100 * _CALM, self.dropped)
        if old and not self._old:
            _log.warning("spool: the oldest rows have waited for %.1f days", self.age_s / 86_400)
        self._old = old

    def _lose(self, damaged: Segment) -> None:
        """Give up what damage has destroyed; where the disk does not give the file out again, nothing."""
        try:
            lost = damaged.lose_unreadable()
        except OSError as error:
            self._pause(damaged, error)
            return
        if not lost:
            return
        self.dropped += lost
        damaged.damaged = max(1, damaged.damaged)
        _log.error("spool: %s is damaged: %d rows cannot be read any more", damaged.path, lost)
        self._log.delete_if_done(damaged)

    def _pause(self, segment: Segment, error: OSError) -> None:
        """The disk does not give a segment out: its rows wait, and are tried again after a pause."""
        if not self._unreadable:
            self._unreadable = True
            _log.error("spool: %s cannot be read (%s); its rows wait, trying again", segment.path, error.strerror)
        segment.trouble = f"{segment.path} cannot be read: {error.strerror or error}"
        segment.paused_until = time.monotonic() + self._backoff.pause_s()
        self._look_again = True

    def _drop(self, segment: Segment) -> None:
        self._lost(sum(len(rows) for rows in segment.pending.values()), "dropping the oldest rows")
        self._log.delete(segment)

    def _lost(self, rows: int, what: str) -> None:
        self.dropped += rows
        if rows and not self._dropping:
            self._dropping = True
            _log.error("spool is full: %s", what)

    def _name(self, stream: Stream) -> bytes:
        name = self._names.get(stream)
        if name is None:
            name = self._names[stream] = stream.encoded()
        return name
