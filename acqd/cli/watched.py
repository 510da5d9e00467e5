"""What `acqd watch` has seen: summaries, health and predictions of every device."""

from __future__ import annotations

import time
from typing import Any

import orjson
from rich.console import Group, RenderableType
from rich.text import Text

from acqd.cli.sparkline import Traces
from acqd.cli.table import power_table
from acqd.telemetry import topics

_QUIET_S = 3.0
_VALUES = ("Vrms", "Irms", "P", "S", "PF", "f", "W")


class Watched:
    """The latest of everything, and since when nothing has come."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._latest: dict[tuple[str, str], dict[str, Any]] = {}
        self._traces = Traces()
        self._health: dict[str, str] = {}
        self._predicted: dict[str, str] = {}
        self._time = ""
        self._since = time.monotonic()
        self._trouble = ""
        self.summaries = 0
        self.was_connected = False

    def connected(self) -> None:
        """The broker answers."""
        self.was_connected, self._trouble, self._since = True, "", time.monotonic()

    def lost(self, reason: str) -> None:
        """The broker has gone."""
        self._trouble, self._since = reason, time.monotonic()

    def take(self, topic: str, payload: bytes) -> bool:
        """Take a message; False for one that is not acqd's."""
        from acqd.integrations.plain import summary_of  # here: slow to import, and the first table is waited for

        device = topic.split("/")[1]
        try:
            if topic == topics.status(device):
                self._health[device] = _health(payload)
            elif topic.endswith("/prediction/live"):
                self._predicted[device] = f"predicted {float(orjson.loads(payload)['P_predicted']):.1f} W"
            elif (summary := summary_of(topic, payload)) is not None:
                values = {name: summary.get(name) for name in _VALUES}  # a stranger's need not have them all
                numbers = {name: None if value is None else float(value) for name, value in values.items()}
                self._summary(summary | numbers | {"flags": summary.get("flags") or []})
            else:
                return False
        except (orjson.JSONDecodeError, KeyError, TypeError, ValueError):
            return False
        return True

    def _summary(self, summary: dict[str, Any]) -> None:
        self._time = str(summary["time"])
        self._latest[summary["device"], summary["channel"]] = summary
        self._traces.add(summary)
        self.summaries += 1
        self._since = time.monotonic()

    def table(self) -> RenderableType:
        """The table with health, predictions and what is being waited for."""
        parts: list[RenderableType] = []
        if self._latest:
            parts.append(power_table(self._latest, f"acqd watch  {self._time}", self._traces.lines()))
        for device in sorted({*self._health, *self._predicted}):
            known = (self._health.get(device), self._predicted.get(device))
            parts.append(Text(f"{device}: {'; '.join(text for text in known if text)}"))
        if waiting := self._waiting():
            parts.append(Text(waiting))
        return Group(*parts)

    def _waiting(self) -> str:
        quiet_s = time.monotonic() - self._since
        if self._trouble:
            return f"broker {self._address}: {self._trouble}; connecting again for {quiet_s:.0f} s"
        if not self.was_connected:
            return f"connecting to {self._address}"
        if quiet_s > _QUIET_S or not self._latest:
            return f"waiting for rows from {self._address} for {quiet_s:.0f} s"
        return ""


def _health(payload: bytes) -> str:
    """State of a daemon in words. Raises orjson.JSONDecodeError, TypeError."""
    if payload == topics.OFFLINE:
        return "offline"
    status = orjson.loads(payload)
    if not isinstance(status, dict):
        raise TypeError("no status")
    return str(status.get("health") or status.get("state") or "online")
