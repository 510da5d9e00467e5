"""Which daemon a device's rows come from: its status topic says whether they can be expected."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import orjson

from acqd.telemetry import topics

_TABLES = ("boxes", "meters")
"""Keys of a status, or of a box in one, whose tables are named after devices."""


class Daemons:
    """Learns from status messages."""

    def __init__(self) -> None:
        self._named: dict[str, set[str]] = {}
        self._boots: dict[str, str] = {}

    def take(self, daemon: str, payload: bytes) -> None:
        """A status message. What an earlier one said stays true of a daemon that has gone offline."""
        self._named.setdefault(daemon, set())
        try:
            status: Any = orjson.loads(payload)
        except orjson.JSONDecodeError:
            return
        if payload == topics.OFFLINE or not isinstance(status, dict):
            return
        self._named[daemon] = set(_names(status, 2))
        self._boots[daemon] = str(status.get("boot", ""))

    def of(self, device: str, boot: str = "") -> str | None:
        """The daemon of a device: of the same name, else one that names the device, else one with the rows' boot."""
        if device in self._named:
            return device
        for daemon, names in self._named.items():
            if device in names:
                return daemon
        return next((daemon for daemon, known in self._boots.items() if boot and boot == known), None)


def _names(status: dict[str, Any], levels: int) -> Iterator[str]:
    """Devices in a status: of boxes, of meters, and of the meters of a box; no daemon has more levels."""
    for key in _TABLES:
        table = status.get(key)
        for name, content in table.items() if isinstance(table, dict) else ():
            yield str(name)
            if levels > 1 and isinstance(content, dict):
                yield from _names(content, levels - 1)
