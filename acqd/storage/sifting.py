"""What a database refuses of a batch is found by halves, and the rest is stored (ADR 90).

The tables of acqd take every row. Somebody may have added a constraint, a trigger or a partition that is missing now,
or narrowed a column: then one row is refused, and with it the transaction in which all others are.
"""

from __future__ import annotations

import sqlite3
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, TypeAlias

import sqlalchemy as sa

from acqd.errors import without_number
from acqd.storage.away import LeftOutError
from acqd.storage.numbered_rows import under_way
from acqd.storage.outage import OUTAGES

Piece: TypeAlias = Sequence[int]
"""Positions in a batch."""
Begin: TypeAlias = Callable[[], AbstractContextManager[sa.Connection]]
Insert: TypeAlias = Callable[[sa.Connection, Piece], list[int]]
"""Inserts some of a batch; positions of those whose key is stored with other values."""

_NO_TABLE_TAKES = ("22003", "22007", "22008", "22021", "22P05")
"""SQLSTATE: number or time out of range, characters that no column takes (PostgreSQL documentation, appendix A)."""
_OF_VALUES = ("22", "23", "44", "P0")
"""SQLSTATE: data, integrity constraint, check option of a view, raised by a trigger."""
_SQLITE_OF_VALUES = {sqlite3.SQLITE_CONSTRAINT, sqlite3.SQLITE_MISMATCH, sqlite3.SQLITE_TOOBIG, sqlite3.SQLITE_RANGE}
_MOST_FAILURES, _MOST_AT_FIRST = 1_000, 64
"""Attempts of one batch that fail: half a second, and while it seems that the table takes no row at all. Rows that are
not tried by then wait, too."""
_MOST_SUSPECTS = 4_096


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a database does not take something."""

    reason: str
    """What it says, in one line."""
    of: Literal["any table", "values", "table"]
    """What refuses: every table of acqd; this table, for the values of a row; perhaps this table as a whole."""
    code: str = ""


@dataclass(slots=True)
class Sifted:
    """What became of a batch."""

    taken: int = 0
    """Stored, or stored before."""
    differing: list[int] = field(default_factory=list)
    """Of these, positions whose key is stored with other values."""
    refused: dict[int, Refusal] = field(default_factory=dict)
    """By position."""
    unfinished: str = ""
    """Why the database does not take what `finish` adds, else empty."""


Finish: TypeAlias = Callable[[sa.Connection, Sifted], None]
"""Adds to the transaction in which a batch is stored."""


class _TransactionLostError(Exception):
    """A trigger of SQLite has rolled back the whole transaction, savepoints included."""


def refusal_of(error: Exception) -> Refusal | None:
    """Why the database refuses rows; None for an error that no choice of rows mends, such as a server that is away."""
    if isinstance(error, LeftOutError):
        return Refusal(error.reason, "table", "left out")
    if isinstance(error, ValueError | OverflowError):  # the driver cannot even send it
        return Refusal(str(error), "any table")
    cause: Any = error.orig if isinstance(error, sa.exc.DBAPIError) else error
    text = without_number((str(cause).strip().splitlines() or [type(cause).__name__])[0])
    if isinstance(cause, sqlite3.Error):
        code = getattr(cause, "sqlite_errorcode", 0) & 0xFF
        if isinstance(cause, sqlite3.DataError):
            return Refusal(text, "any table")
        if code in _SQLITE_OF_VALUES:
            return Refusal(text, "values", str(code))
        return Refusal(text, "table", str(code)) if code == sqlite3.SQLITE_ERROR else None
    state = getattr(cause, "sqlstate", None) or ""
    if state in _NO_TABLE_TAKES or (not state and isinstance(error, sa.exc.DataError)):
        return Refusal(text, "any table")
    if state.startswith(_OF_VALUES):
        return Refusal(text, "values", state)
    if not state or state.startswith(OUTAGES):
        return None
    return Refusal(text, "table", state)  # rights, policies, functions of triggers, codes that somebody has made up


class Sieve:
    """Stores batches; remembers which rows were refused last, and for which errors others were not."""

    def __init__(self, begin: Begin, *, alone: bool = True) -> None:
        """`begin` begins a transaction. Not `alone`: what follows shows whether the database takes anything."""
        self._begin, self._alone = begin, alone
        self._suspects: set[Hashable] = set()
        self._of_some: set[str] = set()

    def store(self, count: int, key: Callable[[int], Any], insert: Insert, finish: Finish) -> Sifted:
        """Commit all of the positions 0 to `count` that the database takes, and what `finish` adds.

        Rows of one `key` are likely to be refused together. Raises the errors of the database where it is away, or
        takes no row for a reason that may be the table's as a whole.
        """
        likely = {k for k in range(count) if key(k) in self._suspects} if self._suspects else set[int]()
        if not likely:
            try:
                with self._begin() as connection:
                    sifted = Sifted(count, insert(connection, range(count)))
                    finish(connection, sifted)
                return sifted
            except Exception as error:
                if refusal_of(error) is None:
                    raise
        order = sorted(range(count), key=key)
        pieces = [k for k in order if k not in likely], [k for k in order if k in likely]
        try:
            with self._begin() as connection:
                if connection.dialect.name == "postgresql":  # or it would check at the commit, when all are in
                    connection.exec_driver_sql("SET CONSTRAINTS ALL IMMEDIATE")
                sifted = self._by_halves(pieces, insert, finish, partial(_savepoint, connection))
        except _TransactionLostError:
            sifted = self._by_halves(pieces, insert, finish, self._begin)
        self._suspects -= {key(k) for k in likely}
        self._suspects |= {key(k) for k in sifted.refused}
        if len(self._suspects) > _MOST_SUSPECTS:
            self._suspects.clear()
        return sifted

    def _by_halves(self, pieces: Iterable[Piece], insert: Insert, finish: Finish, begin: Begin) -> Sifted:
        """`begin`: a transaction, or a part of one, that holds what is stored together or not at all."""
        sifted = Sifted()
        first = self._try_pieces(pieces, insert, begin, sifted)
        of_table = {why.code for why in sifted.refused.values() if why.of == "table"}
        if sifted.taken:
            self._of_some |= of_table
        elif self._alone and first is not None and not of_table <= self._of_some:
            raise first
        try:
            with begin() as connection:
                finish(connection, sifted)
        except Exception as error:
            if (why := refusal_of(error)) is None:
                raise
            sifted.unfinished = why.reason
        return sifted

    def _try_pieces(self, pieces: Iterable[Piece], insert: Insert, begin: Begin, sifted: Sifted) -> Exception | None:
        """The first error."""
        waiting, failures = deque(piece for piece in pieces if piece), 0
        first, last = None, Refusal("", "values")
        while waiting:
            piece = waiting.popleft()  # the larger pieces first
            some = sifted.taken or last.of != "table" or last.code in self._of_some
            if failures >= (_MOST_FAILURES if some else _MOST_AT_FIRST):
                sifted.refused |= dict.fromkeys(piece, replace(last, of="values") if some else last)
                continue
            try:
                with begin() as connection:
                    differing = insert(connection, piece)
            except Exception as error:
                if (why := refusal_of(error)) is None:
                    raise
                failures, first, last = failures + 1, first or error, why
                half = len(piece) // 2
                if half:
                    waiting += piece[:half], piece[half:]
                else:
                    sifted.refused[piece[0]] = why
            else:
                sifted.taken += len(piece)
                sifted.differing += differing
        return first


@contextmanager
def _savepoint(connection: sa.Connection) -> Iterator[sa.Connection]:
    """A part of a transaction that is undone alone. Raises _TransactionLostError."""
    part = connection.begin_nested()
    try:
        yield connection
    except Exception:
        if connection.dialect.name == "sqlite" and not under_way(connection):
            raise _TransactionLostError from None
        part.rollback()
        raise
    part.commit()
