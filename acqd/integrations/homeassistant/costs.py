"""What `acqd/DEVICE/energy` says; at midnight the day before is completed, so that sums over days lose no minute."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import orjson

from acqd.energy.account import Period
from acqd.energy.running import Running, energy_json
from acqd.telemetry import topics
from acqd.telemetry.message import Message


@dataclass(slots=True)
class Costs:
    """Makes the messages of all devices."""

    _days: dict[str, int] = field(default_factory=dict)
    """Unix s of the day that was published last, by device."""

    def messages(self, running: Running) -> Iterator[Message]:
        """The state of a device; a day's last one first, where the day has ended since the last call."""
        content = _content(running)
        today, yesterday = running.today, running.yesterday
        last = self._days.get(running.device)
        if yesterday is not None and last == yesterday.begin:
            yield _message(running, content | {"today": _day(running, yesterday)})
        if today is not None:
            self._days[running.device] = today.begin
        yield _message(running, content)

    def has(self, running: Running, key: str) -> bool:
        """Whether there is a value for an entity."""
        cost = running.today.cost if running.today is not None else None
        values = {"cost_today": cost, "price": running.price, "standby_share": running.standby_share}
        return values[key] is not None


def _message(running: Running, content: dict[str, Any]) -> Message:
    return Message(topics.energy(running.device), orjson.dumps(content), retain=True)


def _content(running: Running) -> dict[str, Any]:
    share = running.standby_share
    percent = None if share is None else 100 * share
    return running.as_json() | {"today": _day(running, running.today), "standby_percent": percent}


def _day(running: Running, period: Period | None) -> dict[str, Any]:
    since = None if period is None else datetime.fromtimestamp(period.begin, running.zone).isoformat()
    return energy_json(period) | {"since": since}
