"""Which daemon a device's rows come from: its status topic says whether they can be expected."""

from __future__ import annotations

from typing import Any

import orjson

from acqd.telemetry import topics

_LISTS = ("devices", "meters", "sources")
"""Keys of a status whose value names the devices of a daemon that has several."""


class Daemons:
    """Learns from status messages."""

    def __init__(self) -> None:
        self._named: dict[str, set[str]] = {}
        self._boots: dict[str, set[str]] = {}
        self._simulated: dict[str, bool] = {}

    def take(self, daemon: str, payload: bytes) -> None:
        """A status message. What an earlier one said stays true of a daemon that has gone offline."""
        self._named.setdefault(daemon, set())
        try:
            status: Any = orjson.loads(payload)
        except orjson.JSONDecodeError:
            return
        if payload == topics.OFFLINE or not isinstance(status, dict):
            return
        self._named[daemon] = {name for key in _LISTS for name in _names(status.get(key))}
        self._boots[daemon] = {str(status["boot"])} if "boot" in status else set()
        self._simulated[daemon] = status.get("source") == "simulated" or status.get("simulated") is True

    def of(self, device: str, boot: str = "") -> str | None:
        """The daemon of a device: of the same name, else one that names the device, else one with the rows' boot."""
        if device in self._named:
            return device
        for daemon, names in self._named.items():
            if device in names:
                return daemon
        return next((daemon for daemon, boots in self._boots.items() if boot and boot in boots), None)

    def simulated(self, daemon: str | None) -> bool:
        """Whether the daemon has said that its source is simulated."""
        return daemon is not None and self._simulated.get(daemon, False)


def _names(value: Any) -> list[str]:
    """Device names in a status: keys of a table, a list of names, or of tables with a name."""
    if isinstance(value, dict):
        return [str(name) for name in value]
    if isinstance(value, list):
        tables = [entry.get("device") or entry.get("name") for entry in value if isinstance(entry, dict)]
        return [str(name) for name in [*tables, *(entry for entry in value if isinstance(entry, str))] if name]
    return []
