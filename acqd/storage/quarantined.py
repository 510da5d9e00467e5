"""What waits in quarantine: listed, shown, restored to the table where it belongs, or dropped by a person."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeAlias

import orjson
import sqlalchemy as sa

from acqd.errors import UserError
from acqd.storage import events, keyed_rows, rows
from acqd.storage.database import transaction
from acqd.storage.keyed_rows import KeyedRow
from acqd.storage.received import Received, message_row
from acqd.storage.schema import quarantine
from acqd.storage.sifting import Piece, Sieve, Sifted
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.row import PowerRow

_AT_ONCE = 500
_Row: TypeAlias = PowerRow | KeyedRow


@dataclass(frozen=True, slots=True)
class Entry:
    """One message."""

    id: int
    received: str
    """By the clock of the sink's computer."""
    topic: str
    reason: str
    payload: bytes = field(repr=False)

    @property
    def device(self) -> str:
        """By the topic."""
        return self.topic.split("/")[1] if "/" in self.topic else ""

    @property
    def content(self) -> Any:
        """The payload as JSON; as text where it is none."""
        try:
            return orjson.loads(self.payload)
        except ValueError:
            return self.payload.decode(errors="backslashreplace")


@dataclass(frozen=True, slots=True)
class Which:
    """Entries of a person's choice: by number, of a device, with a text in the reason. Nothing chosen: all."""

    ids: Sequence[int] = ()
    device: str | None = None
    reason: str | None = None
    begins: str | None = None
    """With which the reason begins."""

    def condition(self) -> sa.ColumnElement[bool]:
        """For a query."""
        c = quarantine.c
        wanted: list[sa.ColumnElement[bool]] = [sa.true()]
        if self.ids:
            wanted.append(c.id.in_(self.ids))
        if self.device is not None:
            wanted.append(c.topic.startswith(f"acqd/{self.device}/", autoescape=True))
        if self.reason is not None:
            wanted.append(c.reason.contains(self.reason, autoescape=True))
        if self.begins is not None:
            wanted.append(c.reason.startswith(self.begins, autoescape=True))
        return sa.and_(*wanted)


@dataclass(slots=True)
class Restored:
    """What became of the chosen entries."""

    restored: int = 0
    """Rows that are in their tables now, and left the quarantine; those that were there already included."""
    conflicts: int = 0
    """Rows whose key is taken by other values; they stay."""
    unusable: int = 0
    """Messages that are no rows; they stay."""
    refused: int = 0
    """Rows that stay because the database refuses them, or to take them out."""
    why_refused: str = ""
    """What the database says of the first of them."""


def count(engine: sa.Engine, which: Which) -> int:
    """How many entries are chosen."""
    with engine.connect() as connection:
        query = sa.select(sa.func.count()).select_from(quarantine).where(which.condition())
        return int(connection.execute(query).scalar_one())


def entries(engine: sa.Engine, which: Which, limit: int | None = None) -> list[Entry]:
    """The chosen entries, oldest first."""
    with engine.connect() as connection:
        return list(_entries(connection, which, 0, limit))


def restore(engine: sa.Engine, which: Which, *, until_refused: bool = False) -> Restored:
    """Put rows where they belong, exactly as they came; a second time changes nothing.

    With `until_refused`, the rest has to wait once the database refuses some.
    """
    done, after, sieve = Restored(), 0, Sieve(partial(transaction, engine), alone=False)
    while True:
        with engine.connect() as connection:
            some = list(_entries(connection, which, after, _AT_ONCE))
        if not some or (until_refused and done.refused):
            return done
        after = some[-1].id
        _restore(sieve, _rows(some, done), done)


def drop(engine: sa.Engine, which: Which) -> int:
    """Delete entries for good; how many."""
    with transaction(engine) as connection:
        return connection.execute(sa.delete(quarantine).where(which.condition())).rowcount


def require(engine: sa.Engine, which: Which) -> None:
    """Raise UserError for a number that no entry has."""
    there = {entry.id for entry in entries(engine, Which(which.ids))} if which.ids else set()
    if missing := [number for number in which.ids if number not in there]:
        raise UserError(f"quarantine: no entry {missing[0]}; `acqd sink quarantine list` shows the numbers")


def _entries(connection: sa.Connection, which: Which, after: int, limit: int | None) -> Iterator[Entry]:
    c = quarantine.c
    query = sa.select(c.id, c.received, c.topic, c.reason, c.payload).where(which.condition(), c.id > after)
    for number, received, topic, reason, payload in connection.execute(query.order_by(c.id).limit(limit)):
        text = received if isinstance(received, str) else received.isoformat()
        yield Entry(int(number), text, topic, reason, bytes(payload))


def _rows(some: Sequence[Entry], done: Restored) -> list[tuple[int, _Row | PowerEvent]]:
    """Those that are rows, with the numbers of their entries."""
    found: list[tuple[int, _Row | PowerEvent]] = []
    for entry in some:
        try:
            found.append((entry.id, message_row(Received(entry.topic, entry.payload))))
        except ValueError:
            done.unusable += 1
    return found


def _restore(sieve: Sieve, found: Sequence[tuple[int, _Row | PowerEvent]], done: Restored) -> None:
    """Insert rows; entries whose rows are stored then leave the quarantine in the same transaction."""

    def insert(connection: sa.Connection, piece: Piece) -> list[int]:
        taken = _insert(connection, [found[k] for k in piece])
        return [k for k in piece if found[k][0] in taken]

    def finish(connection: sa.Connection, sifted: Sifted) -> None:
        stay = {*sifted.differing, *sifted.refused}
        settled = [number for k, (number, _) in enumerate(found) if k not in stay]
        if settled:
            connection.execute(sa.delete(quarantine).where(quarantine.c.id.in_(settled)))

    sifted = sieve.store(len(found), lambda k: (type(found[k][1]).__name__, found[k][1].device), insert, finish)
    done.conflicts += len(sifted.differing)
    stored = sifted.taken - len(sifted.differing)
    done.restored += 0 if sifted.unfinished else stored
    done.refused += len(sifted.refused) + (stored if sifted.unfinished else 0)  # entries that cannot be deleted
    why = next((why.reason for why in sifted.refused.values()), sifted.unfinished)
    done.why_refused = done.why_refused or why


def _insert(connection: sa.Connection, found: Sequence[tuple[int, _Row | PowerEvent]]) -> set[int]:
    """Insert rows; numbers of the entries whose keys are taken by other values."""
    taken: set[int] = set()
    power = [(number, row) for number, row in found if isinstance(row, PowerRow)]
    if power:
        taken |= {power[k][0] for k in rows.insert(connection, [row for _, row in power])}
    for kind, table in keyed_rows.TABLES.items():
        keyed = [(number, row) for number, row in found if isinstance(row, kind)]
        taken |= {keyed[k][0] for k in keyed_rows.insert(connection, table, [row for _, row in keyed])}
    occurred = [(number, event) for number, event in found if isinstance(event, PowerEvent)]
    if occurred:
        ended = events.insert(connection, [event for _, event in occurred])
        taken |= {number for number, event in occurred if event in ended}
    return taken
