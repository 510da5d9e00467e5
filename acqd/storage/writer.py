"""Batches of messages into SQL: one transaction, exactly once by key, what is no new row into quarantine.

A row whose key is stored with equal values has come before. With other values it is a conflict: the stored row stays,
the other one goes into quarantine.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import sqlalchemy as sa

from acqd.storage import boot_watch, events, keyed_rows, last_rows, quarantining, rows
from acqd.storage.allowance import MALFORMED_BYTES_PER_DAY, Allowance
from acqd.storage.boot_watch import BootWatch
from acqd.storage.clock_witness import FLAG, IMPOSSIBLE, ClockWitness
from acqd.storage.guard import Guard
from acqd.storage.receipted import note, note_refused
from acqd.storage.received import Message, Refused, Row, Sorted, by_stream, sort
from acqd.telemetry import topics
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.receipts import LastRow
from acqd.telemetry.register_row import RegisterRow
from acqd.telemetry.row import PowerRow
from acqd.telemetry.spool import Stream

_log = logging.getLogger(__name__)
CONFLICT = "another row with this key is stored"
_OF_A_ROW = ("22003", "22007", "22008", "22021", "22P05")
"""SQLSTATE: number or time out of range, characters that no column takes (PostgreSQL documentation, appendix A)."""


@dataclass(slots=True)
class Written:
    """What became of a batch."""

    rows: int = 0
    """Valid rows, those already known included."""
    quarantined: int = 0
    """Messages that are no new rows, kept or not."""
    conflicts: int = 0
    """Of these, rows whose key is stored with other values."""
    impossible: int = 0
    """Of these, rows whose time cannot be true; they can be restored."""
    receipts: dict[Stream, Ranges] = field(default_factory=dict)
    """Every row of the batch that need not be sent again."""
    answers: dict[str, list[LastRow]] = field(default_factory=dict)
    """By device, the last rows that are stored now: of devices that have asked."""


class _PoisonError(Exception):
    """The database will never take this batch as it is."""


class Writer:
    """Writes to one database; not for several threads at once."""

    def __init__(
        self,
        engine: sa.Engine,
        malformed_bytes_per_day: float = MALFORMED_BYTES_PER_DAY,
        client_id: str = "acqd-sink",
        witness: ClockWitness | None = None,
    ) -> None:
        """Malformed messages beyond this size are not kept, and not receipted; rows are always kept."""
        self._engine = engine
        self._allowance = Allowance(malformed_bytes_per_day)
        self.witness = witness or ClockWitness()
        self.boots = BootWatch()
        self.guard = Guard(engine, client_id, self.witness)
        self._full = False

    def write(self, messages: Sequence[Message]) -> Written:
        """Commit all rows of `messages`, or none.

        Raises sqlalchemy.exc.DBAPIError while the database cannot, DatabaseAwayError when it is not the one of the
        start. Voltage events have a separate transaction; storing one twice changes nothing.
        """
        self.guard.open()
        self.witness.look()
        found = sort(messages)
        stored = events.store(self.guard.transaction, found.events, self.witness)
        unusable = [*found.refused, *((found.events[k], reason) for k, reason in stored.refused)]
        refused = [one for one in unusable if not one[1].startswith(IMPOSSIBLE)]
        good, origins, impossible = self._judged(found)
        impossible += [one for one in unusable if one[1].startswith(IMPOSSIBLE)]
        streams = by_stream(good)
        self._flag_boots(streams)
        kept = refused[: self._allowance.fitting([_size(message) for message, _ in refused])]
        try:
            conflicts, poison = self._store(good, origins, [*kept, *impossible])
        except self._engine.dialect.loaded_dbapi.Error as error:  # from COPY, which SQLAlchemy does not see
            raise sa.exc.DBAPIError("COPY", None, error) from error
        self._spend(kept, len(refused))
        no_rows = conflicts + poison
        written = Written(len(good) - no_rows, len(refused) + len(impossible) + no_rows, conflicts, len(impossible))
        for stream, of in streams.items():
            written.receipts[stream] = Ranges()
            written.receipts[stream].add_all([row.seq for row in of])
        for message, _ in [*kept, *impossible]:
            note_refused(written.receipts, message)
        for event in stored.events:
            note(written.receipts, event.device, topics.EVENTS, event.boot, event.seq)
        if found.asks:
            with self._engine.connect() as connection:
                for question in last_rows.questions(found.asks):
                    written.answers[question.device] = last_rows.last_rows(connection, question)
        return written

    def _judged(self, found: Sorted) -> tuple[list[Row], list[Message], list[Refused]]:
        """Rows whose time may be true, flagged where that is in doubt, their messages; and those that cannot be."""
        for device, ticks in {row.device: row.filetime for row in found.rows}.items():
            self.witness.hear(device, ticks)
        if self.witness.all_plausible([row.filetime for row in found.rows]):
            return found.rows, found.origins, []
        good: list[Row] = []
        origins: list[Message] = []
        impossible: list[Refused] = []
        for message, row in zip(found.origins, found.rows, strict=True):
            try:
                judged = self.witness.judge(row.device, row.filetime, row.time, getattr(row, "flags", ()))
            except ValueError as error:
                impossible.append((message, str(error)))
                continue
            if judged == "doubtful" and not isinstance(row, RegisterRow):
                row.flags = sorted({*row.flags, FLAG})
            good.append(row)
            origins.append(message)
        return good, origins, impossible

    def _flag_boots(self, streams: Mapping[Stream, Sequence[Row]]) -> None:
        power = [
            (stream.device, stream.boot, cast(Sequence[PowerRow], of))
            for stream, of in streams.items()
            if isinstance(of[0], PowerRow)
        ]
        spans: dict[tuple[str, str], tuple[int, int]] = {}
        for device, boot, of in power:
            ticks = [row.filetime for row in of]
            first, newest = spans.get((device, boot), (ticks[0], ticks[0]))
            spans[device, boot] = min(first, min(ticks)), max(newest, max(ticks))
        mixed = {name for name, span in spans.items() if self.boots.hear(*name, *span)}
        for device, boot, of in power:
            for row in of if (device, boot) in mixed else ():
                row.flags = sorted({*row.flags, boot_watch.FLAG})

    def _spend(self, kept: list[Refused], refused: int) -> None:
        """Note what is kept of the malformed messages, and say once that no more are."""
        self._allowance.spend([_size(message) for message, _ in kept])
        full = len(kept) < refused
        if full and not self._full:
            _log.error("the quarantine has taken its bytes of a day: further malformed messages are only counted")
        if refused:
            self._full = full

    def _store(self, good: list[Row], origins: list[Message], apart: list[Refused]) -> tuple[int, int]:
        """Commit rows, and what is set apart, in one transaction; how many rows conflict, and are poison.

        The database refuses some row of the batch for what it holds: find it by halves, keep the others.
        """
        try:
            return self._commit(good, origins, apart), 0
        except _PoisonError as error:
            if len(good) == 1:
                self._commit([], [], [(origins[0], str(error)), *apart])
                return 0, 1
        half = len(good) // 2
        first = self._store(good[:half], origins[:half], apart)
        second = self._store(good[half:], origins[half:], [])
        return first[0] + second[0], first[1] + second[1]

    def _commit(self, good: list[Row], origins: list[Message], apart: list[Refused]) -> int:
        """One transaction; the number of conflicts. Raises _PoisonError for rows that no database takes.

        A broken constraint is no such error, nor a text that is too long: the tables of acqd have none that a row could
        break but the key, so somebody has changed them, and the database is away until that is taken back.
        """
        dbapi = self._engine.dialect.loaded_dbapi
        with self.guard.transaction() as connection:
            differing: list[Message] = []
            try:
                kinds = set(map(type, good))
                for kind in kinds:
                    of = good if len(kinds) == 1 else [row for row in good if row.__class__ is kind]
                    if where := _insert(connection, kind, of):
                        positions = [k for k, row in enumerate(good) if row.__class__ is kind]
                        differing += [origins[positions[k]] for k in where]
            except (sa.exc.DataError, dbapi.DataError) as error:
                if not _is_of_a_row(error):
                    raise
                raise _PoisonError(str(error).splitlines()[0]) from error
            except (ValueError, OverflowError) as error:  # the driver cannot even send it
                raise _PoisonError(str(error)) from error
            if apart or differing:
                quarantining.insert(connection, [*apart, *((message, CONFLICT) for message in differing)])
        return len(differing)


def _insert(connection: sa.Connection, kind: type[Row], of: list[Any]) -> list[int]:
    """Insert what is new of the rows of a kind; positions of those whose key is stored with other values."""
    for keyed, table in keyed_rows.TABLES.items():
        if kind is keyed:
            return keyed_rows.insert(connection, table, of)
    return rows.insert(connection, of)


def _is_of_a_row(error: Exception) -> bool:
    """Whether a value is refused that no table of acqd takes, in PostgreSQL by SQLSTATE."""
    state = getattr(getattr(error, "orig", error), "sqlstate", None)
    return state is None or state in _OF_A_ROW


def _size(message: Message) -> int:
    """Bytes that the quarantine would keep of a message."""
    return min(len(message.payload), quarantining.PAYLOAD_KEPT)
