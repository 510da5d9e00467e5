"""Whether energy registers began below what an earlier run has published: an older state_dir was put back.

The broker keeps the last summary of every channel. A run that has ended in order asks nobody for its last rows
(ADR 32), so this is the only witness against its files. One phase is enough: all registers of a device are in one file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import orjson

from acqd.telemetry import topics

_CHANNEL = "L1"
_ROUNDED_KWH = 1e-9


class _Seen(NamedTuple):
    boot: str
    time: str
    imported: float
    exported: float


class RegisterWitness:
    """Of devices whose registers continue after a restart; for one event loop."""

    def __init__(self, devices: Iterable[str]) -> None:
        self._devices = set(devices)
        self._published: dict[str, _Seen] = {}
        self._began: dict[str, _Seen] = {}

    def subscriptions(self) -> list[str]:
        """Summaries that the broker has kept."""
        return [topics.summary(device, _CHANNEL) for device in sorted(self._devices)]

    def heard(self, topic: str, payload: bytes, *, retained: bool) -> None:
        """A summary; those of this run come back from the broker, too."""
        device = topic.split("/")[1]
        if not retained or device in self._published or topic != topics.summary(device, _CHANNEL):
            return
        try:
            self._published[device] = _seen(orjson.loads(payload))
        except (ValueError, LookupError, TypeError):
            return

    def began(self, summary: Mapping[str, Any]) -> None:
        """A summary of this run."""
        device = summary["device"]
        if summary["channel"] == _CHANNEL and device in self._devices and device not in self._began:
            self._began[device] = _seen(summary)

    @property
    def trouble(self) -> str:
        """Which register has gone back, else empty."""
        for device, now in self._began.items():
            before = self._published.get(device)
            if before is None or before.boot.partition(".")[0] == now.boot.partition(".")[0]:
                continue
            for name, value, had in (("W", now.imported, before.imported), ("W_export", now.exported, before.exported)):
                if value < had - _ROUNDED_KWH:
                    return (
                        f"{name} of {device} began at {value:.6g} kWh, and an earlier run had published {had:.6g} kWh "
                        f"at {before.time}; was an older state_dir put back?"
                    )
        return ""


def _seen(summary: Mapping[str, Any]) -> _Seen:
    """Raises LookupError, TypeError, ValueError."""
    readings = float(summary["W_import"]), float(summary["W_export"])
    return _Seen(str(summary["boot"])[:128], str(summary["time"])[:40], *readings)
