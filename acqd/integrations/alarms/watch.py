"""From messages to alarms: the bridge of `acqd alarms`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import Any

import orjson

from acqd.energy.budget import Standing
from acqd.integrations.alarms.book import Alarm, Book, Notification
from acqd.integrations.alarms.budgets import KIND, BudgetAlarms
from acqd.integrations.alarms.states import wrong
from acqd.telemetry import topics
from acqd.telemetry.message import Message

ACTIVE = "acqd/alarms/active"
"""Retained: a list of the active alarms."""
ACKNOWLEDGE = "acqd/alarms/acknowledge"
"""{"key": DEVICE/KIND, "by": NAME}; not retained."""
_RESIDUAL = "acqd/+/prediction/alarm"


class AlarmWatch:
    """Collects what is wrong and tells it."""

    def __init__(
        self,
        book: Book,
        tell: Callable[[Notification], None],
        delay_s: float,
        now: Callable[[], int] = time.time_ns,
        standings: Callable[[], Sequence[Standing] | None] = lambda: None,
    ) -> None:
        """`tell` hands a notification to the targets, `now` is UTC in ns; `standings`: of budgets, if there is news."""
        self._book, self._tell, self._delay_ns, self._now = book, tell, round(delay_s * 1e9), now
        self._pending: dict[str, tuple[int, str]] = {}
        self._published: bytes | None = None
        self._budgets, self._standings = BudgetAlarms(book), standings

    def subscriptions(self) -> Sequence[str]:
        """Alarms of sidecars, states of daemons, acknowledgements."""
        return _RESIDUAL, topics.ALL_STATUS, ACKNOWLEDGE

    def will(self) -> None:
        """No last will."""

    def begin(self) -> Iterable[Message]:
        """A broker without persistence has lost the list."""
        self._published = None
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """An alarm, a state or an acknowledgement."""
        device = topic.split("/")[1]
        if topic == ACKNOWLEDGE:
            self._acknowledge(payload)
        elif topic.endswith("/prediction/alarm"):
            self._residual(device, payload)
        elif topic == topics.status(device):
            self._states(device, payload)
        return self._news()

    def tick(self) -> Iterable[Message]:
        """States that have lasted, and reminders."""
        now = self._now()
        for key, (since, text) in list(self._pending.items()):
            if now - since >= self._delay_ns:
                del self._pending[key]
                self._all(self._book.raise_(key, text, since))
        if (standings := self._standings()) is not None:
            self._all(self._budgets.take(standings, now))
        self._all(self._book.remind(now))
        return self._news()

    def _residual(self, device: str, payload: bytes) -> None:
        """The sidecar's alarm; an empty message ends it."""
        key = f"{device}/residual"
        if not payload:
            self._all(self._book.resolve(key))
            return
        try:
            alarm: Any = orjson.loads(payload)
        except orjson.JSONDecodeError:
            return
        if isinstance(alarm, dict):
            chart = str(alarm.get("chart", "a chart"))[:80]
            text = f"{device}: measured power no longer follows the model ({chart}); run acqd close-loop"
            identity = orjson.dumps(alarm, option=orjson.OPT_SORT_KEYS).decode()[:2000]
            self._all(self._book.raise_(key, text, self._now(), identity, alarm))

    def _states(self, daemon: str, payload: bytes) -> None:
        faults = wrong(payload)
        if faults is None:
            return
        now, mine = self._now(), f"{daemon}/"
        current = {f"{mine}{kind}": f"{daemon}: {text}" for kind, text in faults.items()}
        for key, text in current.items():
            if key not in self._book.active:
                self._pending.setdefault(key, (now, text))
        if "offline" in faults:
            return  # nothing is known of its other troubles
        ended = [key for key in (*self._pending, *self._book.active) if key.startswith(mine) and key not in current]
        for key in ended:
            self._pending.pop(key, None)
            if not key.endswith("/residual") and f"/{KIND}" not in key:
                self._all(self._book.resolve(key))

    def _acknowledge(self, payload: bytes) -> None:
        try:
            content: Any = orjson.loads(payload)
            key, by = str(content["key"]), str(content.get("by", ""))[:80]
        except (orjson.JSONDecodeError, KeyError, TypeError, AttributeError):
            return
        self._all(self._book.acknowledge(key, by))

    def _all(self, notifications: Iterable[Notification]) -> None:
        for notification in notifications:
            self._tell(notification)

    def _news(self) -> Iterable[Message]:
        """The list of active alarms, when it has changed."""
        payload = orjson.dumps([_public(alarm) for alarm in self._book.active.values()])
        if payload == self._published:
            return ()
        self._published = payload
        return [Message(ACTIVE, payload, retain=True)]


def _public(alarm: Alarm) -> dict[str, Any]:
    about = asdict(alarm)
    return {name: about[name] for name in ("key", "text", "since", "acknowledged_by", "details")}
