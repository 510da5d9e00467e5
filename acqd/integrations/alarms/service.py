"""Book, targets and state file of one `acqd alarms`."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import orjson

from acqd.atomic import write_complete
from acqd.energy.budget import Standing
from acqd.errors import OperationError
from acqd.integrations.alarms.book import Alarm, Book, Notification
from acqd.integrations.alarms.history import History, history_file
from acqd.integrations.alarms.section import AlarmsSection
from acqd.integrations.alarms.sender import Sender
from acqd.integrations.alarms.targets import targets_of
from acqd.integrations.alarms.watch import AlarmWatch
from acqd.integrations.regularly import Regularly

_log = logging.getLogger(__name__)


class Alarms:
    """`watch` is the bridge; use as a context."""

    def __init__(self, section: AlarmsSection, budgets: Regularly[list[Standing]] | None = None) -> None:
        """`budgets` is entered and left with the service."""
        self._path = section.state
        self._book = Book(section.remind_h * 3600)
        self._history = History(history_file(section.state))
        self._lock = threading.Lock()
        self.sender = Sender(targets_of(section), self.save)
        self._budgets = budgets
        # Without budgets there are no standings: alarms of budgets that have been removed end.
        standings: Callable[[], list[Standing] | None] = list if budgets is None else budgets.newest
        self.watch = AlarmWatch(self._book, self._tell, section.delay_s, standings=standings)
        self._restore()

    def __enter__(self) -> Alarms:
        self.sender.__enter__()
        if self._budgets is not None:
            self._budgets.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        if self._budgets is not None:
            self._budgets.__exit__()
        self.sender.__exit__()
        self.save()

    def save(self) -> None:
        """Write alarms and waiting notifications to the state file; from any thread."""
        with self._lock:
            alarms = [asdict(alarm) for alarm in list(self._book.active.values())]
            state = {"alarms": alarms, "waiting": self.sender.waiting()}
            try:
                write_complete(self._path, orjson.dumps(state))
            except OperationError as error:
                _log.error("%s", error)

    def _tell(self, notification: Notification) -> None:
        _log.warning("%s", notification.line())
        self._history.add(notification, time.time_ns())
        self.sender.put(notification.as_json())
        self.save()

    def _restore(self) -> None:
        """Continue where an earlier run ended; a state that cannot be read is left out: alarms are told again."""
        state: Any = {}
        with contextlib.suppress(OSError, orjson.JSONDecodeError):
            state = orjson.loads(self._path.read_bytes())
        try:
            self._book.active = {entry["key"]: Alarm(**entry) for entry in state.get("alarms", [])}
            self.sender.restore(state.get("waiting", {}))
        except (TypeError, KeyError, AttributeError):
            _log.warning("%s is no state of acqd alarms; starting with an empty one", self._path)
