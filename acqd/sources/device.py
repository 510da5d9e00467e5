"""What all sources with their own sampling clock have in common: numbering, queue, health."""

from __future__ import annotations

import time
from collections.abc import Callable

from acqd.errors import UserError
from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.block import Codes
from acqd.sources.base import Source, SourceHealth
from acqd.sources.numbering import SampleNumbering
from acqd.sources.queue import BlockQueue

Clock = Callable[[], int]
"""Nanoseconds that only rise; tests pass a virtual one."""


class DeviceSource(Source):
    """A device that samples by itself. `exchange` brings its samples, `read` hands them out."""

    paced = False

    def __init__(self, clock: Clock = time.monotonic_ns) -> None:
        self._clock = clock
        self._utc_offset = 0
        self._health = SourceHealth()

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Start at sample number `index`, now (`utc_ns`)."""
        self._utc_offset = utc_ns - self._clock()
        self._numbering.open(utc_ns, index)

    def read(self, limit: int) -> SampleBlock:
        """The next unbroken samples with equal flags."""
        return self._blocks.take(limit)

    def health(self) -> SourceHealth:
        """Connection and losses."""
        return self._health

    def _declare(self, form: StreamFormat) -> None:
        """The device is there and delivers `form`."""
        self.form = form
        self._numbering = SampleNumbering(form.rate)
        self._blocks = BlockQueue(form)

    def _place(
        self, codes: Codes, counter: int, taken_ns: int, flags: frozenset[str] = frozenset(), slack_ns: int = 0
    ) -> None:
        """Queue samples whose first has device number `counter` and was taken at `taken_ns` on the clock.

        `slack_ns`: how far from that it may have been. Samples that are known already are passed over.
        """
        block = self._numbering.place(codes, counter, taken_ns + self._utc_offset, flags, slack_ns)
        if block is not None:
            self._blocks.put(block)

    def _lose(self, reason: str) -> None:
        """The device is out of reach."""
        health = self._health
        self._health = SourceHealth(False, reason, self._lost, health.reconnects)

    def _find(self, warning: str = "") -> None:
        """Samples arrive; `warning` says what is wrong with them all the same."""
        health = self._health
        if not health.connected or health.lost != self._lost or health.reason != warning:
            self._health = SourceHealth(True, warning, self._lost, health.reconnects + (not health.connected))

    @property
    def _lost(self) -> int:
        return self._numbering.lost + self._blocks.dropped


def stream_format(rate: float, scale: tuple[float, ...], f_nominal: float, **more: int) -> StreamFormat:
    """StreamFormat of a device. Raises UserError for a scale or rate that cannot be right."""
    try:
        return StreamFormat(rate, scale, f_nominal, **more)  # type: ignore[arg-type]
    except ValueError as error:
        raise UserError(f"source: {error}") from None
