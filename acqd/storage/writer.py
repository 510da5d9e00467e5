"""Batches of messages into SQL: one transaction, exactly once by key, what is no new row into quarantine.

A row whose key is stored with equal values has come before. With other values it is a conflict: the stored row stays,
the other one goes into quarantine.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, TypeAlias, cast

import sqlalchemy as sa

from acqd.garbage import uncollected
from acqd.storage import boot_watch, events, keyed_rows, last_rows, quarantining, rows
from acqd.storage.allowance import MALFORMED_BYTES_PER_DAY, Allowance
from acqd.storage.boot_watch import BootWatch
from acqd.storage.clock_witness import FLAG, IMPOSSIBLE, ClockWitness
from acqd.storage.database_witness import DatabaseWitness
from acqd.storage.guard import Guard
from acqd.storage.receipted import note, note_refused
from acqd.storage.received import Message, Refused, Row, Sorted, by_stream, sort
from acqd.storage.refusals import Refusals, Waiting
from acqd.storage.sifting import Piece, Sieve, Sifted
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.receipts import LastRow
from acqd.telemetry.register_row import RegisterRow
from acqd.telemetry.row import PowerRow
from acqd.telemetry.spool import Stream

_log = logging.getLogger(__name__)
_Span: TypeAlias = tuple[int, int]
"""`filetime` of the oldest and the newest row."""
_ticks, _seq = attrgetter("filetime"), attrgetter("seq")
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
    waiting: int = 0
    """Rows and events that a changed table refuses: they have no receipt."""
    receipts: dict[Stream, Ranges] = field(default_factory=dict)
    """Every row of the batch that need not be sent again."""
    answers: dict[last_rows.Asked, list[LastRow]] = field(default_factory=dict)
    """The last rows that are stored now, by question."""


class Writer:
    """Writes to one database; not for several threads at once."""

    def __init__(
        self,
        engine: sa.Engine,
        malformed_bytes_per_day: float = MALFORMED_BYTES_PER_DAY,
        client_id: str = "acqd-sink",
        witness: ClockWitness | None = None,
        memory: DatabaseWitness | None = None,
    ) -> None:
        """Malformed messages beyond this size are not kept, and not receipted; rows are always kept."""
        self._engine = engine
        self._allowance = Allowance(malformed_bytes_per_day)
        self.witness = witness or ClockWitness()
        self.boots = BootWatch()
        self.guard = Guard(engine, client_id, self.witness, memory)
        self.refusals = Refusals(malformed_bytes_per_day)
        self._rows, self._events = Sieve(self.guard.transaction), Sieve(self.guard.transaction, alone=False)
        self._full = False

    def write(self, messages: Sequence[Message]) -> Written:
        """Commit the rows of `messages`.

        Raises sqlalchemy.exc.DBAPIError while the database cannot, DatabaseAwayError when it is not the one of the
        start; then none is stored, or they get no receipt. Rows that a changed table refuses alone have no receipt.
        Voltage events have a separate transaction; storing one twice changes nothing.
        """
        self.guard.open()
        self.witness.look()
        with uncollected():  # a tenth of the time
            return self._written(sort(messages))

    def _written(self, found: Sorted) -> Written:
        occurred, unusable = events.judged(found.events, self.witness)
        stored = self._store_events(occurred)
        unusable = [*found.refused, *unusable, *stored.unusable]
        refused = [one for one in unusable if not one[1].startswith(IMPOSSIBLE)]
        spans = _spans(found.streams)
        good, origins, impossible = self._judged(found, spans)
        impossible += [one for one in unusable if one[1].startswith(IMPOSSIBLE)]
        streams = found.streams
        if len(good) < len(found.rows):
            streams = by_stream(good)
            spans = _spans(streams)
        self._flag_boots(streams, spans)
        kept = refused[: self._allowance.fitting([_size(message) for message, _ in refused])]
        batch = self._store(good, origins, [*kept, *impossible], stored.waiting)
        sifted, poison = batch.sifted, batch.poison
        self._spend(kept, len(refused))
        conflicts = len(sifted.differing)
        waiting = len(sifted.refused) - poison + len(stored.waiting)
        written = Written(
            sifted.taken - conflicts, len(refused) + len(impossible) + conflicts + poison, conflicts, len(impossible),
            waiting,
        )  # fmt: skip
        unreceipted = {id(good[k]) for k in batch.without_receipt}
        for stream, of in streams.items():
            written.receipts[stream] = Ranges()
            named = [row for row in of if id(row) not in unreceipted] if unreceipted else of
            written.receipts[stream].add_all(list(map(_seq, named)))
        for message, _ in [*kept, *impossible] if not sifted.unfinished else ():
            note_refused(written.receipts, message)
        for event in stored.events:
            note(written.receipts, event.device, topics.EVENTS, event.boot, event.seq)
        if found.asks:
            with self._engine.connect() as connection:
                for question in last_rows.questions(found.asks):
                    written.answers[question] = last_rows.last_rows(connection, question)
        return written

    def _judged(self, found: Sorted, spans: Mapping[Stream, _Span]) -> tuple[list[Row], list[Message], list[Refused]]:
        """Rows whose time may be true, flagged where that is in doubt, their messages; and those that cannot be."""
        latest: dict[str, int] = {}
        for stream, (_, newest) in spans.items():
            latest[stream.device] = max(newest, latest.get(stream.device, newest))
        for device, newest in latest.items():
            self.witness.hear(device, newest)
        if self.witness.all_plausible([ticks for span in spans.values() for ticks in span]):
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

    def _flag_boots(self, streams: Mapping[Stream, Sequence[Row]], spans: Mapping[Stream, _Span]) -> None:
        power = {stream: cast(Sequence[PowerRow], of) for stream, of in streams.items() if isinstance(of[0], PowerRow)}
        boots: dict[tuple[str, str], _Span] = {}
        for stream in power:
            first, newest = spans[stream]
            known = boots.get((stream.device, stream.boot), (first, newest))
            boots[stream.device, stream.boot] = min(first, known[0]), max(newest, known[1])
        mixed = {name for name, span in boots.items() if self.boots.hear(*name, *span)}
        for stream, of in power.items():
            for row in of if (stream.device, stream.boot) in mixed else ():
                row.flags = sorted({*row.flags, boot_watch.FLAG})

    def _spend(self, kept: list[Refused], refused: int) -> None:
        """Note what is kept of the malformed messages, and say once that no more are."""
        self._allowance.spend([_size(message) for message, _ in kept])
        full = len(kept) < refused
        if full and not self._full:
            _log.error("the quarantine has taken its bytes of a day: further malformed messages are only counted")
        if refused:
            self._full = full

    def _store_events(self, occurred: Sequence[tuple[Message, PowerEvent]]) -> _Events:
        """Commit events; what became of them."""
        done = _Events()
        if not occurred:
            return done

        def insert(connection: sa.Connection, piece: Piece) -> list[int]:
            ended = events.insert(connection, [occurred[k][1] for k in piece])
            return [k for k in piece if occurred[k][1] in ended]

        sifted = self._events.store(len(occurred), lambda k: occurred[k][1].device, insert, lambda *_: None)
        for k, (message, event) in enumerate(occurred):
            if (why := sifted.refused.get(k)) is None and k not in sifted.differing:
                done.events.append(event)
            elif why is None:
                done.unusable.append((message, events.CONFLICT))
            elif why.of == "any table":
                done.unusable.append((message, why.reason))
            else:
                done.waiting.append((message, event.device, why.reason))
        return done

    def _store(
        self, good: list[Row], origins: list[Message], apart: list[Refused], waiting: Sequence[Waiting]
    ) -> _Batch:
        """Commit rows, what is set apart, and copies of what the database refuses, in one transaction."""

        def insert(connection: sa.Connection, piece: Piece) -> list[int]:
            differing: list[int] = []
            of = good if isinstance(piece, range) else [good[k] for k in piece]
            kinds = set(map(type, of))
            for kind in kinds:
                where = piece
                if len(kinds) > 1:
                    where = [k for k in piece if good[k].__class__ is kind]
                    of = [good[k] for k in where]
                differing += [where[k] for k in _insert(connection, kind, of)]
            return differing

        def finish(connection: sa.Connection, sifted: Sifted) -> None:
            poison = [(origins[k], why.reason) for k, why in sifted.refused.items() if why.of == "any table"]
            conflicts = [(origins[k], CONFLICT) for k in sifted.differing]
            if apart or conflicts or poison:
                quarantining.insert(connection, [*apart, *conflicts, *poison])
            if waiting or len(sifted.refused) > len(poison):
                self.refusals.keep(connection, [*waiting, *_waiting(sifted, good, origins)])

        sifted = self._rows.store(len(good), lambda k: _stream_of(good[k]), insert, finish)
        wait = [*waiting, *_waiting(sifted, good, origins)]
        if sifted.unfinished:
            unkept = [*(message for message, _ in apart), *(origins[k] for k in [*sifted.differing, *sifted.refused])]
            wait += [(message, topics.place(message.topic).device, sifted.unfinished) for message in unkept]
        if wait:
            self.refusals.note(wait)
        return _Batch(sifted)


@dataclass(slots=True)
class _Events:
    """What became of the events of a batch."""

    events: list[PowerEvent] = field(default_factory=list)
    unusable: list[Refused] = field(default_factory=list)
    waiting: list[Waiting] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _Batch:
    """What became of the rows of a batch."""

    sifted: Sifted

    @property
    def poison(self) -> int:
        """Rows that no table takes."""
        return sum(why.of == "any table" for why in self.sifted.refused.values())

    @property
    def without_receipt(self) -> list[int]:
        """Positions of the rows that are neither stored nor in quarantine."""
        sifted = self.sifted
        if sifted.unfinished:
            return [*sifted.refused, *sifted.differing]
        return [k for k, why in sifted.refused.items() if why.of != "any table"]


def _spans(streams: Mapping[Stream, Sequence[Row]]) -> dict[Stream, _Span]:
    times = {stream: list(map(_ticks, of)) for stream, of in streams.items()}
    return {stream: (min(ticks), max(ticks)) for stream, ticks in times.items()}


def _waiting(sifted: Sifted, good: Sequence[Row], origins: Sequence[Message]) -> list[Waiting]:
    """Rows that the table refuses, with device and reason."""
    return [(origins[k], good[k].device, why.reason) for k, why in sifted.refused.items() if why.of != "any table"]


def _stream_of(row: Row) -> tuple[str, ...]:
    return row.__class__.__name__, row.device, row.channel, row.boot


def _insert(connection: sa.Connection, kind: type[Row], of: list[Any]) -> list[int]:
    """Insert what is new of the rows of a kind; positions of those whose key is stored with other values."""
    for keyed, table in keyed_rows.TABLES.items():
        if kind is keyed:
            return keyed_rows.insert(connection, table, of)
    return rows.insert(connection, of)


def _size(message: Message) -> int:
    """Bytes that the quarantine would keep of a message."""
    return min(len(message.payload), quarantining.PAYLOAD_KEPT)
