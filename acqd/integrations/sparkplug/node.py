"""The edge node: birth and death of the node and of its devices, data in between (Sparkplug 3.0)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from acqd import __version__
from acqd.daemon.quality_section import BridgedQuality
from acqd.integrations.daemons import Daemons
from acqd.integrations.plain import summary_of
from acqd.integrations.quality import QUALITY, level, orders, quality_of, wanted
from acqd.integrations.quantities import SUMMARY
from acqd.integrations.sparkplug.payload import Metric, asks_for_rebirth, payload
from acqd.telemetry import topics
from acqd.telemetry.message import Message
from acqd.telemetry.quality_row import QualityRow

_REBIRTH = "Node Control/Rebirth"


@dataclass(slots=True)
class _Device:
    """What its birth certificate lists."""

    metrics: dict[str, Metric] = field(default_factory=dict)
    heard_s: float = 0.0
    boot: str = ""
    alive: bool = False


class Node:
    """One edge node; every device of acqd is a device of it."""

    def __init__(
        self, group: str, name: str, stale_s: float = 60.0, clock: Callable[[], float] = time.time,
        quality: BridgedQuality = "150/180",
    ) -> None:  # fmt: skip
        """A device without summaries for `stale_s` is declared dead. `clock`: Unix s.

        `quality`: rows of power quality from this aggregation on.
        """
        self._group, self._name, self._stale_s, self._clock = group, name, stale_s, clock
        self._quality = wanted(quality)
        self._birth = self._seq = -1
        self._devices: dict[str, _Device] = {}
        self._daemons = Daemons()
        self._offline: set[str] = set()

    def subscriptions(self) -> Sequence[str]:
        """Commands to the node first, then what becomes data."""
        measured = (topics.ALL_SUMMARIES, topics.ALL_QUALITY) if self._quality else (topics.ALL_SUMMARIES,)
        return self._topic("NCMD"), topics.ALL_STATUS, *measured

    def will(self) -> Message:
        """Death of the node; asked for once per connection, whose birth has the same number."""
        self._birth = (self._birth + 1) % 256
        return Message(self._topic("NDEATH"), payload(self._ms(), [self._number()]))

    def begin(self) -> Iterable[Message]:
        """Birth of the node, then of the devices that live."""
        self._seq = -1
        control = Metric(_REBIRTH, False, self._ms(), bool)
        version = Metric("Properties/acqd version", __version__, self._ms(), str)
        yield self._message("NBIRTH", [self._number(), control, version])
        for name, device in self._devices.items():
            if device.alive:
                yield self._message("DBIRTH", device.metrics.values(), name)

    def take(self, topic: str, content: bytes) -> Iterable[Message]:
        """A command, a state, a summary or a row of power quality."""
        if topic == self._topic("NCMD"):
            return self.begin() if asks_for_rebirth(content) else ()
        if topic.endswith("/status"):
            return self._status(topic.split("/")[1], content)
        if topic.endswith("/quality"):
            row = quality_of(topic, content)
            return () if row is None or row.aggregation not in self._quality else self._of_quality(row)
        summary = summary_of(topic, content)
        return () if summary is None else self._data(summary)

    def tick(self) -> Iterable[Message]:
        """Deaths of devices that have been silent."""
        now = self._clock()
        return [self._death(name) for name, each in self._devices.items() if each.alive and self._late(each, now)]

    def _late(self, device: _Device, now_s: float) -> bool:
        return now_s - device.heard_s > self._stale_s

    def _status(self, daemon: str, content: bytes) -> Iterator[Message]:
        self._daemons.take(daemon, content)
        if content != topics.OFFLINE:
            self._offline.discard(daemon)
            return
        self._offline.add(daemon)
        for name, device in self._devices.items():
            if device.alive and self._daemons.of(name, device.boot) == daemon:
                yield self._death(name)

    def _data(self, summary: dict[str, Any]) -> Iterator[Message]:
        name, boot = str(summary["device"]), str(summary.get("boot", ""))
        if self._daemons.of(name, boot) in self._offline:
            return  # a retained summary of a daemon that is gone
        device = self._devices.setdefault(name, _Device())
        device.heard_s, device.boot = self._clock(), boot
        yield self._measured(name, device, _metrics(summary))

    def _of_quality(self, row: QualityRow) -> Iterator[Message]:
        """Of a device that lives: summaries say whether a device does."""
        device = self._devices.get(row.device)
        if device is not None and device.alive:
            yield self._measured(row.device, device, _quality_metrics(row))

    def _measured(self, name: str, device: _Device, values: Iterable[Metric]) -> Message:
        metrics = {metric.name: metric for metric in values}
        known = device.alive and metrics.keys() <= device.metrics.keys()
        device.metrics |= metrics
        device.alive = True
        # another channel is another birth: the certificate lists every metric that data may have
        kind, content = ("DDATA", metrics) if known else ("DBIRTH", device.metrics)
        return self._message(kind, content.values(), name)

    def _death(self, name: str) -> Message:
        self._devices[name].alive = False
        return self._message("DDEATH", [], name)

    def _message(self, kind: str, metrics: Iterable[Metric], device: str = "") -> Message:
        self._seq = (self._seq + 1) % 256
        return Message(self._topic(kind, device), payload(self._ms(), metrics, self._seq))

    def _topic(self, kind: str, device: str = "") -> str:
        return f"spBv1.0/{self._group}/{kind}/{self._name}{f'/{device}' if device else ''}"

    def _number(self) -> Metric:
        """Pairs a death with the birth before it."""
        return Metric("bdSeq", self._birth, self._ms(), int)

    def _ms(self) -> int:
        return round(self._clock() * 1000)


def _metrics(summary: dict[str, Any]) -> Iterator[Metric]:
    channel = summary["channel"]
    try:
        ms = round(datetime.fromisoformat(str(summary.get("time"))).timestamp() * 1000)
    except ValueError:
        return
    for quantity in SUMMARY:
        yield Metric(f"{channel}/{quantity.key}", summary.get(quantity.key), ms)
    yield Metric(f"{channel}/flags", " ".join(map(str, summary.get("flags") or [])), ms, str)


def _quality_metrics(row: QualityRow) -> Iterator[Metric]:
    """L1/quality/150-180/V_thds, .../V_h/3; every quantity of the channel, so that one birth suffices."""
    ms = round(datetime.fromisoformat(row.time).timestamp() * 1000)
    place = f"{row.channel}/quality/{level(row.aggregation)}"
    for each in QUALITY:
        yield Metric(f"{place}/{each.key}", getattr(row, each.key), ms)
    for name, order, value in orders(row):
        yield Metric(f"{place}/{name}/{order}", value, ms)
