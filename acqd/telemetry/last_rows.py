"""What a sink and the broker know of the last rows before a power cut: asked before the first row after it.

Rows leave at once, and reach the disk of the daemon within a second. After a cut of its power, rows may be stored whose
energy its registers do not know.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import orjson
from msgspec import UNSET

from acqd.telemetry import topics
from acqd.telemetry.ask import Ask, encode
from acqd.telemetry.message import Message
from acqd.telemetry.receipts import LastRow, Receipt

_AGAIN_S = 1.0
_OTHERS_S = 1.5
"""How long other sinks that are there may take for their answer after the first one: those of a group share the rows,
and only one of them gets the question."""


@dataclass(frozen=True, slots=True)
class Reading:
    """The registers of a channel in a retained summary [kWh]."""

    seq: int
    imported: float
    exported: float


@dataclass(slots=True)
class Known:
    """What was heard of one device and boot, by channel."""

    boot: str
    stored: dict[str, LastRow] = field(default_factory=dict)
    summaries: dict[str, Reading] = field(default_factory=dict)
    sinks: set[str] = field(default_factory=set)
    """Status topics of those that have answered."""

    @property
    def answered(self) -> bool:
        """Whether a sink has answered."""
        return bool(self.sinks)

    def is_of(self, boot: str) -> bool:
        """Whether a boot is this one or its continuation after a clock that was set back (`boot.1`)."""
        return boot == self.boot or boot.startswith(f"{self.boot}.")

    def add(self, row: LastRow) -> None:
        """A row, if it is of this boot: the last one of a channel counts."""
        before = self.stored.get(row.channel)
        if self.is_of(row.boot) and (before is None or row.seq > before.seq):
            self.stored[row.channel] = row


class LastRows:
    """Asks for devices whose last run has ended with the power; for one event loop."""

    def __init__(
        self,
        boots: Mapping[str, str],
        now: Callable[[], float] = time.monotonic,
        sinks: Callable[[], Collection[str]] = tuple,
    ) -> None:
        """`boots`: the last boot of every device to ask for; `sinks`: those that say that they are there."""
        self._sinks = sinks
        self._known = {device: Known(boot) for device, boot in boots.items()}
        self._now, self._ask_at, self._ask_until = now, -1e9, -1e9
        self._answered = asyncio.Event()

    def subscriptions(self) -> Iterable[str]:
        """Topics of answers."""
        for device in self._known:
            yield topics.receipt(device)
            yield topics.summary(device, "+")

    def questions(self) -> list[Message]:
        """What to ask now: again every second while somebody waits, for a sink may be about to start."""
        now = self._now()
        if now > self._ask_until or now - self._ask_at < _AGAIN_S:
            return []
        self._ask_at = now
        return [
            Message(topics.ask(device), encode(Ask("last_rows", known.boot)))
            for device, known in self._known.items()
            if not self._complete(known)
        ]

    def heard_summary(self, topic: str, payload: bytes) -> None:
        """A retained summary."""
        known = self._known.get(topic.split("/")[1])
        try:
            summary: Any = orjson.loads(payload)
            reading = Reading(int(summary["seq"]), float(summary["W_import"]), float(summary["W_export"]))
            channel, boot = str(summary["channel"]), str(summary["boot"])
        except (ValueError, KeyError, TypeError):
            return
        if known is not None and known.is_of(boot):
            known.summaries[channel] = reading

    def answered(self, device: str, receipt: Receipt) -> None:
        """The answer of a sink."""
        known, rows = self._known.get(device), receipt.last or []
        if known is None:
            return
        if receipt.boot not in (UNSET, known.boot) or (rows and not any(known.is_of(row.boot) for row in rows)):
            return  # late, to the question of an earlier start about the boot before
        for row in rows:
            known.add(row)
        known.sinks.add(topics.sink_status(receipt.sink))
        self._answered.set()

    async def of(self, device: str, patience_s: float) -> Known | None:
        """What is known of a device, once the sinks have answered or patience ends; None: there was nothing to ask."""
        known, ends = self._known.get(device), self._now() + patience_s
        self._ask_until = max(self._ask_until, ends)
        while known is not None and not self._complete(known):
            if known.answered:
                ends = min(ends, self._now() + _OTHERS_S)
            if (left := ends - self._now()) <= 0:
                break
            self._answered.clear()
            try:
                await asyncio.wait_for(self._answered.wait(), left)
            except TimeoutError:
                break
        return known

    def _complete(self, known: Known) -> bool:
        return known.answered and known.sinks.issuperset(self._sinks())
