"""Reads SQL in a thread at regular times, for a bridge whose event loop must go on."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

import sqlalchemy as sa

from acqd.changes import StateLog
from acqd.errors import UserError
from acqd.storage.database import first_line, read_database

_log = logging.getLogger(__name__)
Answer = TypeVar("Answer")


class Regularly(Generic[Answer]):
    """Use as a context; `newest` hands over each answer once."""

    def __init__(
        self, database: str, read: Callable[[sa.Engine], Answer], period_s: float,
        without: Callable[[str], Answer] | None = None,
    ) -> None:  # fmt: skip
        """`without` makes the answer when the database gives none, from the reason; None: there is no answer then."""
        self._database, self._read, self._period_s, self._without = database, read, period_s, without
        self._engine: sa.Engine | None = None
        self._changes = StateLog(_log)
        self._stopping = threading.Event()
        self._answers: list[Answer] = []
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="sql", daemon=True)
        self.failures = 0
        """In a row."""
        self.trouble = ""

    def __enter__(self) -> Regularly[Answer]:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join(2.0)

    def newest(self) -> Answer | None:
        """The newest answer that was not taken yet."""
        with self._lock:
            answers, self._answers = self._answers, []
        return answers[-1] if answers else None

    def _run(self) -> None:
        while True:
            self.once()
            if self._stopping.wait(self._period_s):
                return

    def once(self) -> None:
        """Read now; what goes wrong is logged, and tried again at the next time."""
        try:
            self._engine = self._engine or read_database(self._database)
            answer = self._read(self._engine)
        except (UserError, sa.exc.DBAPIError) as error:
            self._failed(str(error) if isinstance(error, UserError) else first_line(error))
            return
        except Exception as error:  # the thread goes on whatever the rows hold
            if self._failed(f"{type(error).__name__}: {error}"):
                _log.exception("this is an error of acqd")
            return
        self.failures, self.trouble = 0, ""
        self._changes.fine("database", "answers")
        self._put(answer)

    def _failed(self, why: str) -> bool:
        """Whether it was written to the log: it had worked before."""
        self.trouble = why
        self.failures += 1
        if self._without is not None:
            self._put(self._without(why))
        return self._changes.trouble("database", "away", f"{why}; trying again")

    def _put(self, answer: Answer) -> None:
        with self._lock:
            self._answers = [answer]
