"""The alarms that are active: each is told once, reminded of until it is acknowledged, and told when it has ended."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from acqd.timestamps import rfc3339

Event = Literal["raised", "reminder", "acknowledged", "resolved"]


@dataclass(slots=True)
class Alarm:
    """One cause, from its beginning to its end."""

    key: str
    """DEVICE/KIND: one alarm of a kind per device."""
    text: str
    """One line for people."""
    since: str
    """RFC 3339."""
    identity: str = ""
    """Another identity under the same key is another alarm (a residual that changed again)."""
    details: dict[str, Any] = field(default_factory=dict)
    acknowledged_by: str = ""
    told_ns: int = 0
    """When it was told last [ns UTC]."""


@dataclass(frozen=True, slots=True)
class Notification:
    """What targets are told."""

    event: Event
    alarm: Alarm

    def as_json(self) -> dict[str, Any]:
        """The body of a webhook; `text` is what chat servers (Mattermost, Slack, Rocket.Chat) show."""
        about = asdict(self.alarm)
        device, _, kind = self.alarm.key.partition("/")
        shown = {name: about[name] for name in ("key", "since", "acknowledged_by", "details")}
        return {"event": self.event, "device": device, "kind": kind, "text": self.line(), **shown}

    def line(self) -> str:
        """One line for people."""
        by = f" by {self.alarm.acknowledged_by}" if self.event == "acknowledged" else ""
        return f"[acqd] {self.event}{by}: {self.alarm.text} (since {self.alarm.since})"


class Book:
    """Active alarms by key."""

    def __init__(self, remind_s: float) -> None:
        self._remind_ns = round(remind_s * 1e9)
        self.active: dict[str, Alarm] = {}

    def raise_(
        self, key: str, text: str, now_ns: int, identity: str = "", details: Any = None
    ) -> Iterator[Notification]:
        """An alarm; the notification if it is a new one."""
        known = self.active.get(key)
        if known is not None and known.identity == identity:
            return
        alarm = Alarm(key, text, rfc3339(now_ns, 3), identity, details or {}, told_ns=now_ns)
        self.active[key] = alarm
        yield Notification("raised", alarm)

    def resolve(self, key: str) -> Iterator[Notification]:
        """The cause has gone."""
        alarm = self.active.pop(key, None)
        if alarm is not None:
            yield Notification("resolved", alarm)

    def acknowledge(self, key: str, by: str) -> Iterator[Notification]:
        """Somebody cares about it: no more reminders. An unknown or acknowledged key is ignored."""
        alarm = self.active.get(key)
        if alarm is not None and not alarm.acknowledged_by:
            alarm.acknowledged_by = by or "somebody"
            yield Notification("acknowledged", alarm)

    def remind(self, now_ns: int) -> Iterator[Notification]:
        """Alarms that were told long ago and that nobody has acknowledged."""
        for alarm in self.active.values():
            due = self._remind_ns and now_ns - alarm.told_ns >= self._remind_ns
            if due and not alarm.acknowledged_by:
                alarm.told_ns = now_ns
                yield Notification("reminder", alarm)
