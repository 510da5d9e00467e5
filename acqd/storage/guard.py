"""Is this still the database that rows were written to? Asked before every commit, so that no receipt lies (ADR 31).

A file that was moved away takes rows for ever, through the descriptor that is open. A server may be another one, or an
earlier state of the same. Each is a named trouble: rows wait with the broker and the daemons meanwhile.
"""

from __future__ import annotations

import logging
import os
import shutil
import sqlite3
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

import sqlalchemy as sa

from acqd.storage import state
from acqd.storage.away import DatabaseAwayError
from acqd.storage.clock_witness import ClockWitness
from acqd.storage.database import file_of, transaction
from acqd.storage.database_witness import DatabaseWitness
from acqd.storage.url import shown
from acqd.telemetry.receipts import Commits

_log = logging.getLogger(__name__)
_NAME = 12
"""Characters of a name in a receipt."""
_HEAD, _FRAME = 32, 24
"""Of the write-ahead log, and of each page in it [bytes]."""
_LOG = "its write-ahead log (-wal)"
_MOVED = "the file was moved away or deleted while the sink ran; put it back, or restart the sink"


class _There(NamedTuple):
    """A file of the database."""

    identity: tuple[int, int]
    """Device and inode."""
    size: int
    """Bytes."""


class Guard:
    """Of the transactions of one sink; for one thread."""

    def __init__(
        self, engine: sa.Engine, client_id: str, witness: ClockWitness, memory: DatabaseWitness | None = None
    ) -> None:
        """`memory`: what earlier starts of the sink know."""
        self._memory = memory or DatabaseWitness(None, client_id)
        self._engine, self._key, self._witness = engine, state.commits(client_id), witness
        self._recalled_key, self._run_key = state.recalled(client_id), state.run(client_id)
        self._identity: str | None = None
        self._number = 0
        self._run, self._after, self._begun, self._known = "", "", 0, 0
        self._path = file_of(engine)
        self.restored = 0
        """Times the database was found in an earlier state."""
        self.recall = 0
        """Times that the database may lack rows that daemons still have: they are to be sent again."""
        self.recalled = ""
        """Name of the last such event, also of an earlier start: daemons may have been away since. Empty: none."""
        self._unwritten, self._head = False, b""
        self._cut = ""
        """What was found of a log that is not whole and could not be set aside yet: the disk was full."""
        self.commits: Commits | None = None
        """Of the last transaction, for receipts; None before the first one. Other threads read it."""

    def open(self) -> None:
        """Read at the start what the database remembers, before the first row is judged. Raises as `transaction`."""
        if self._identity is None:
            with self.transaction():
                pass

    @contextmanager
    def transaction(self) -> Iterator[sa.Connection]:
        """All statements or none, in the database that was opened at the start.

        Raises DatabaseAwayError when it is another one, or not there; the errors of SQLAlchemy.
        """
        self._check_file()
        if self._cut and self._stat(self._log) is not None:
            raise self._left(None, self._cut, cut=True)
        with transaction(self._engine) as connection:
            self._check_connection(connection)
            known = self._read(connection)
            number = self._check_state(connection, known) + 1
            self._check_run(connection, number - 1, known.get(self._run_key, ""))
            state.write_mark(connection, self._key, self._witness.mark(number))
            if self._unwritten:
                state.write(connection, self._recalled_key, self.recalled)
            yield connection
            about = connection.connection.info
            end = self._end_of_log(self._check_connection(connection))
        if end and not self._page_at(end):
            raise self._left(None, f"{_LOG} was cut off while the sink wrote to it; opening it again", cut=True)
        self._note_log(about)
        self._number, self._unwritten = number, False
        if self._identity is not None:
            self._memory.committed(self._identity, number)
        self.commits = Commits((self._identity or "")[:_NAME], self._run, self._after, self._begun, number)

    def close(self) -> None:
        """Remember how far the database is."""
        self._memory.write()

    def _check_file(self) -> None:
        """Before anything connects: SQLite would make a file where none is."""
        if self._path is not None and self._identity is not None and self._stat() is None:
            self._engine.dispose()
            raise self._away(_MOVED)

    def _check_connection(self, connection: sa.Connection) -> int:
        """The length of the log; 0: there is none [bytes]."""
        if self._path is None:
            return 0
        about, now = connection.connection.info, self._stat()
        if about.get("file") not in (None, now and now.identity):
            raise self._left(
                connection,
                _MOVED if now is None else "the file was replaced while the sink ran; opening the new one",
            )
        log = self._stat(self._log)  # a transaction has begun, so SQLite has opened it
        identity = log and log.identity
        if about.setdefault("log", identity) != identity:
            if log is None:  # what is in it, through the descriptor that is open, goes into the file
                opened: Any = connection.connection.dbapi_connection
                with suppress(sqlite3.Error):
                    opened.rollback()
                    opened.execute("PRAGMA wal_checkpoint")
            raise self._left(connection, f"{_LOG} was deleted or replaced while the sink ran; opening it again")
        for name, there in (("the file", now), (_LOG, log)):
            if there is not None and there.size < about.get(name, 0):
                reason = f"{name} became shorter while the sink ran; opening it again"
                raise self._left(connection, reason, cut=there is log and self._head_of_log() == self._head)
            about[name] = there.size if there is not None else 0
        return log.size if log is not None else 0

    def _end_of_log(self, size: int) -> int:
        """Where the last page in the log begins; 0: none is there.

        A log that is cut off while it is written to has its length again, with a hole in it: the page is gone then
        (SQLite, "WAL-mode file format", sections 1 and 2).
        """
        if not size:
            return 0
        self._head = self._head_of_log()
        page = int.from_bytes(self._head[8:12], "big") + _FRAME
        begin = (size - _HEAD) // page * page - page + _HEAD
        return begin if page > _FRAME and begin >= _HEAD and self._page_at(begin) else 0

    def _note_log(self, about: dict[Any, Any]) -> None:
        """After a commit, which may have restarted the log, and may be most of it."""
        if self._path is not None and (log := self._stat(self._log)) is not None:
            about[_LOG], self._head = log.size, self._head_of_log()

    def _head_of_log(self) -> bytes:
        """Whoever empties the log as SQLite does writes another one; empty where the disk does not say."""
        with suppress(OSError), open(self._log, "rb", buffering=0) as log:
            return log.read(_HEAD)
        return b""

    def _page_at(self, begin: int) -> bool:
        """Whether there is one in the log: none has the number 0. True where the disk does not say."""
        try:
            with open(self._log, "rb", buffering=0) as log:
                log.seek(begin)
                return any(log.read(4))
        except OSError:
            return True  # the next transaction looks for the file

    @property
    def _log(self) -> str:
        """SQLite has it beside the file that a symbolic link leads to."""
        return f"{os.path.realpath(str(self._path))}-wal"

    def _left(self, connection: sa.Connection | None, reason: str, *, cut: bool = False) -> DatabaseAwayError:
        """The next transaction opens the file again: what pages are in memory, and where, is true no more.

        `cut`: the log is not whole. Whoever closes the file last moves what is there of a transaction into it, and a
        part of one damages it; so nothing is there meanwhile. Whole ones count when the file is opened.
        """
        kept = f"{self._log}.cut"
        self._cut = reason if cut else ""
        try:
            if cut:
                self._copy_log(kept)
                os.truncate(self._log, 0)
            if connection is not None:
                connection.invalidate()
            self._engine.dispose()  # other threads have the old file open, too
            if cut:
                os.replace(kept, self._log)  # who else has the file open keeps the empty log, and moves nothing
            self._cut = ""
        except OSError as error:
            return self._away(f"{reason}: {error.strerror or error}")
        return self._away(reason)

    def _copy_log(self, kept: str) -> None:
        """A copy that a full disk ends is deleted. Raises OSError."""
        try:
            shutil.copyfile(self._log, kept)
        except OSError:
            with suppress(OSError):
                os.unlink(kept)
            raise

    def _stat(self, path: str | None = None) -> _There | None:
        """The file, or its log; None where it is not there.

        Raises DatabaseAwayError where its disk or share does not say.
        """
        try:
            found = os.stat(path or str(self._path))
        except FileNotFoundError:
            return None
        except OSError as error:
            raise self._away(error.strerror or str(error)) from None
        return _There((found.st_dev, found.st_ino), found.st_size)

    def _ask_again(self) -> None:
        """Rows are missing that daemons still have. The name goes into the database with the next commit."""
        self.recalled, self._unwritten, self._known = uuid.uuid4().hex, True, self._number
        self.recall += 1

    def _read(self, connection: sa.Connection) -> dict[str, str]:
        """What the database says of itself and of this sink."""
        try:
            return state.read_some(connection, state.IDENTITY, self._key, self._run_key)
        except (sa.exc.OperationalError, sa.exc.ProgrammingError) as error:
            if "no such table" not in str(error.orig) and getattr(error.orig, "sqlstate", "") != "42P01":
                if self._path is not None:  # what SQLite believes of the log is shared by all who have it open
                    connection.invalidate()
                    self._engine.dispose()
                raise
            raise self._away(
                "its tables are gone: empty, another one, or a schema that the role may not use; restart the sink to "
                "have them made"
            ) from None

    def _check_state(self, connection: sa.Connection, known: dict[str, str]) -> int:
        """Number of the last commit of this sink in the database."""
        identity, mark = known.get(state.IDENTITY), state.mark_of(known.get(self._key))
        if self._identity is None:
            self._identity = identity
            self._number = max(mark.number if mark is not None else 0, self._memory.number(str(identity)))
            self.recalled = state.read(connection, self._recalled_key) or ""
            if not self._number and not state.has_commits(connection):  # new, or what a server has failed over to
                self._ask_again()
            self._witness.remember(mark)
            self._witness.look()
        elif identity != self._identity:
            raise self._away("it is another database than before; restart the sink to use it")
        number = mark.number if mark is not None else 0
        if number < self._number:
            self.restored += 1
            self._ask_again()
            _log.error(
                "database %s is in an earlier state (commit %d, was %d): restored? Daemons send again what they have",
                shown(self._engine.url), number, self._number,
            )  # fmt: skip
            self._number = number
        return number

    def _check_run(self, connection: sa.Connection, number: int, last: str) -> None:
        """Where `last`, the run of the last commit, is another one (a start, a copy of the database), receipts name it.

        What the sink has found itself, daemons hear by its name: receipts go on from the commit that was known.
        """
        if self._unwritten:
            last, number = "", self._known
        elif self._run and last == self._run:
            return
        self._run, self._after, self._begun = uuid.uuid4().hex[:_NAME], last[:_NAME], number
        state.write(connection, self._run_key, self._run)

    def _away(self, reason: str) -> DatabaseAwayError:
        text = f"{shown(self._engine.url)}: {reason}"
        return DatabaseAwayError(f"database {text}", text)
