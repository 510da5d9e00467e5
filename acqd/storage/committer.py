"""The thread that writes batches: the connection to the broker lives on while the database is slow, locked or away."""

from __future__ import annotations

import logging
import os
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import sqlalchemy as sa

from acqd.retry import Backoff
from acqd.storage.away import DatabaseAwayError
from acqd.storage.database import first_line, prepare
from acqd.storage.received import Message
from acqd.storage.url import shown
from acqd.storage.writer import Writer, Written

_log = logging.getLogger(__name__)
_T = TypeVar("_T")
_AHEAD = 2
"""Batches that may wait behind the one that is being written."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Messages, and what the connection needs to acknowledge them."""

    messages: Sequence[Message]
    numbers: list[int]
    connection: int
    begun: float
    """Monotonic time at which its first message came [s]."""


class Committer:
    """`submit` batches, collect them from `done` when they are committed; `readable` wakes a select()."""

    def __init__(self, engine: sa.Engine, writer: Writer | None = None, *, prepared: bool = True) -> None:
        """`prepared`: the database was reached and has its tables; otherwise the thread does that first."""
        self._engine, self._prepared = engine, prepared
        self._writer = writer or Writer(engine)
        self._todo: queue.SimpleQueue[Batch | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[tuple[Batch, Written]] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="committer", daemon=True)
        self._failure: Exception | None = None
        self.readable = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._under_way: deque[Batch] = deque()
        self.trouble = ""
        """Why the database takes nothing, else empty."""
        self.returns = 0
        """Times the database came back."""
        self._thread.start()

    @property
    def room(self) -> bool:
        """Whether another batch may be submitted."""
        return self.busy <= _AHEAD

    @property
    def busy(self) -> int:
        """Batches that are not committed."""
        return len(self._under_way)

    @property
    def waits_s(self) -> float:
        """How long the oldest of them has waited for its commit; 0: no row waits [s]."""
        return time.monotonic() - self._under_way[0].begun if self._under_way else 0.0

    def submit(self, batch: Batch) -> None:
        """Have a batch written; it is tried until the database takes it."""
        self._under_way.append(batch)
        self._todo.put(batch)

    def done(self) -> list[tuple[Batch, Written]]:
        """Batches that were committed since the last call.

        Raises what has ended the thread: UserError for a database that cannot be used once it is back, else a bug.
        """
        try:
            os.eventfd_read(self.readable)
        except BlockingIOError:
            return []
        finished = []
        while not self._done.empty():
            finished.append(self._done.get())
        for _ in finished:
            self._under_way.popleft()
        if self._failure is not None:
            raise self._failure
        return finished

    def close(self, timeout: float) -> None:
        """Finish the batch in progress if it takes no longer than `timeout` [s]; the rest comes again."""
        self._stopping.set()
        self._todo.put(None)
        self._thread.join(timeout)

    def _run(self) -> None:
        try:
            if self._insist(self._open) is None:
                return
            os.eventfd_write(self.readable, 1)
            while (batch := self._todo.get()) is not None and not self._stopping.is_set():
                written = self._insist(partial(self._writer.write, batch.messages))
                if written is None:
                    return
                self._done.put((batch, written))
                os.eventfd_write(self.readable, 1)
        except Exception as error:
            self._failure = error
            os.eventfd_write(self.readable, 1)
        finally:
            self._writer.guard.close()

    def _open(self) -> bool:
        """Before the first row: daemons hear that the database is new while no row in it has a receipt."""
        if not self._prepared:
            prepare(self._engine)
        self._writer.guard.open()
        return True

    def _insist(self, work: Callable[[], _T]) -> _T | None:
        """What `work` returns once the database takes it; None when the thread is to end."""
        backoff = Backoff()
        while True:
            try:
                done = work()
            except DatabaseAwayError as error:
                self._away(error.reason)
            except sa.exc.DBAPIError as error:
                self._away(first_line(error))
            except OSError as error:  # a disk or share in between: as little an end as what the database says
                self._away(f"{shown(self._engine.url)}: {error.strerror or error}")
            else:
                if self.trouble:
                    _log.warning("the database takes rows again")
                    self.returns += 1
                self.trouble = ""
                return done
            if self._stopping.wait(backoff.pause_s()):
                return None

    def _away(self, reason: str) -> None:
        if not self.trouble:
            _log.error("database: %s; rows wait, trying again", reason)
        self.trouble = reason
