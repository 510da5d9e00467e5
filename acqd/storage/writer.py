"""Batches of messages into SQL: one transaction, exactly once by key, what is no new row into quarantine.

A row whose key is stored with equal values has come before. With other values it is a conflict: the stored row stays,
the other one goes into quarantine.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field

import sqlalchemy as sa

from acqd.storage import boot_watch, events, keyed_rows, last_rows, quarantining, rows
from acqd.storage.allowance import MALFORMED_BYTES_PER_DAY, Allowance
from acqd.storage.boot_watch import BootWatch
from acqd.storage.clock_witness import FLAG, IMPOSSIBLE, ClockWitness
from acqd.storage.guard import Guard
from acqd.storage.receipted import note, note_refused
from acqd.storage.received import Parsed, Received, Row, parse, rows_apart, stream_channel
from acqd.telemetry import topics
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.receipts import LastRow
from acqd.telemetry.register_row import RegisterRow
from acqd.telemetry.row import PowerRow
from acqd.telemetry.spool import Stream

_log = logging.getLogger(__name__)
CONFLICT = "another row with this key is stored"


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

    def write(self, messages: Sequence[Received]) -> Written:
        """Commit all rows of `messages`, or none.

        Raises sqlalchemy.exc.DBAPIError while the database cannot, DatabaseAwayError when it is not the one of the
        start. Voltage events have a separate transaction; storing one twice changes nothing.
        """
        self.guard.open()
        self.witness.look()
        occurred = [message for message in messages if topics.is_event(message.topic)]
        stored = events.store(self.guard.transaction, occurred, self.witness)
        malformed = [(occurred[k], reason) for k, reason in stored.refused]
        asked = [(message.topic, message.payload) for message in messages if topics.is_ask(message.topic)]
        rows_only = [one for one in messages if not (topics.is_event(one.topic) or topics.is_ask(one.topic))]
        parsed = [parse(message) for message in rows_apart(rows_only, malformed)]
        for one in parsed:
            if one.row is not None:
                self.witness.hear(one.row.device, one.row.filetime)
        written = self._write(parsed, malformed)
        for event in stored.events:
            note(written.receipts, event.device, topics.EVENTS, event.boot, event.seq)
        for question in last_rows.questions(asked):
            with self._engine.connect() as connection:
                written.answers[question.device] = last_rows.last_rows(connection, question)
        return written

    def _write(self, messages: Sequence[Parsed], malformed: Sequence[tuple[Received, str]]) -> Written:
        """`messages` of one row each; `malformed` are kept for their reasons."""
        good: list[tuple[Received, Row]] = []
        refused, impossible = list(malformed), []
        for message, row, reason in messages:
            if row is None:
                refused.append((message, reason))
                continue
            try:
                judged = self.witness.judge(row.device, row.filetime, row.time, getattr(row, "flags", ()))
            except ValueError as error:
                impossible.append((message, str(error)))
                continue
            if judged == "doubtful" and not isinstance(row, RegisterRow):
                row.flags = sorted({*row.flags, FLAG})
            good.append((message, row))
        self._flag_boots([row for _, row in good if isinstance(row, PowerRow)])
        rows_refused = [one for one in refused if one[1].startswith(IMPOSSIBLE)]
        refused = [one for one in refused if not one[1].startswith(IMPOSSIBLE)]
        impossible += rows_refused
        kept = refused[: self._allowance.fitting([_size(message) for message, _ in refused])]
        try:
            conflicts = self._store(good, [*kept, *impossible])
        except self._engine.dialect.loaded_dbapi.Error as error:  # from COPY, which SQLAlchemy does not see
            raise sa.exc.DBAPIError("COPY", None, error) from error
        except _PoisonError as error:
            return self._apart(messages, malformed, str(error))
        self._spend(kept, len(refused))
        quarantined = len(refused) + len(impossible) + conflicts
        written = Written(len(good) - conflicts, quarantined, conflicts, len(impossible))
        for _, row in good:
            note(written.receipts, row.device, stream_channel(row), row.boot, row.seq)
        for message, _ in [*kept, *impossible]:
            note_refused(written.receipts, message)
        return written

    def _flag_boots(self, power: Sequence[PowerRow]) -> None:
        spans: dict[tuple[str, str], list[int]] = {}
        for row in power:
            span = spans.get((row.device, row.boot))
            if span is None:
                spans[row.device, row.boot] = [row.filetime, row.filetime]
            elif row.filetime > span[1]:
                span[1] = row.filetime
        mixed = {name for name, span in spans.items() if self.boots.hear(*name, *span)}
        for row in power if mixed else ():
            if (row.device, row.boot) in mixed:
                row.flags = sorted({*row.flags, boot_watch.FLAG})

    def _spend(self, kept: list[tuple[Received, str]], refused: int) -> None:
        """Note what is kept of the malformed messages, and say once that no more are."""
        self._allowance.spend([_size(message) for message, _ in kept])
        full = len(kept) < refused
        if full and not self._full:
            _log.error("the quarantine has taken its bytes of a day: further malformed messages are only counted")
        if refused:
            self._full = full

    def _apart(self, messages: Sequence[Parsed], malformed: Sequence[tuple[Received, str]], reason: str) -> Written:
        """The database refuses some row of this batch for what it holds: find it, keep the others."""
        if len(messages) == 1:
            self._store([], [(messages[0].message, reason), *malformed])
            written = Written(0, 1 + len(malformed))
            note_refused(written.receipts, messages[0].message)
            return written
        half = len(messages) // 2
        first, second = self._write(messages[:half], malformed), self._write(messages[half:], [])
        for stream, stored in second.receipts.items():
            for pair in stored:
                first.receipts.setdefault(stream, Ranges()).add(*pair)
        return Written(
            first.rows + second.rows,
            first.quarantined + second.quarantined,
            first.conflicts + second.conflicts,
            first.impossible + second.impossible,
            first.receipts,
        )

    def _store(self, good: list[tuple[Received, Row]], refused: list[tuple[Received, str]]) -> int:
        """One transaction; the number of conflicts."""
        dbapi = self._engine.dialect.loaded_dbapi
        with self.guard.transaction() as connection:
            differing: list[int] = []
            try:
                power = [(k, row) for k, (_, row) in enumerate(good) if isinstance(row, PowerRow)]
                if power:
                    differing = [power[k][0] for k in rows.insert(connection, [row for _, row in power])]
                for kind, table in keyed_rows.TABLES.items():
                    keyed = [(k, row) for k, (_, row) in enumerate(good) if isinstance(row, kind)]
                    differing += [keyed[k][0] for k in keyed_rows.insert(connection, table, [row for _, row in keyed])]
            except (sa.exc.DataError, sa.exc.IntegrityError, dbapi.DataError, dbapi.IntegrityError) as error:
                raise _PoisonError(str(error).splitlines()[0]) from error
            except (ValueError, OverflowError) as error:  # the driver cannot even send it
                raise _PoisonError(str(error)) from error
            apart = [*refused, *((good[k][0], CONFLICT) for k in differing)]
            if apart:
                quarantining.insert(connection, apart)
        return len(differing)


def _size(message: Received) -> int:
    """Bytes that the quarantine would keep of a message."""
    return min(len(message.payload), quarantining.PAYLOAD_KEPT)
