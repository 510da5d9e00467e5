"""The daemon's MAIN_FAST and MAIN_SLOW with their ring, driven by samples instead of a timer."""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np

from acqd.metering import Meter, SampleBlock, StreamFormat, WindowBatch
from acqd.metering.block import Codes
from acqd.plc.fast import FastTask, OverrunPolicy
from acqd.plc.ring import Ring, RingLayout
from acqd.plc.slow import SlowTask
from acqd.sources import Source
from acqd.sources.base import CYCLE_NS

_CYCLES = 500  # of MAIN_FAST in one call: half the capacity of the ring
_NEVER_LATE = OverrunPolicy(catch_up_ns=_CYCLES * CYCLE_NS, late_ns=_CYCLES * CYCLE_NS)
SIMULATED = frozenset({"simulated"})


class _QueueSource(Source):
    """A source whose samples come from `put`."""

    live = False
    flags = SIMULATED

    def __init__(self, form: StreamFormat) -> None:
        self.form = form
        self._utc = 0
        self._position = 0
        self._codes: Codes = np.empty((0, len(form.scale)), dtype=np.int16)

    def put(self, codes: Codes) -> None:
        """Append samples [samples, channels]."""
        self._codes = np.concatenate([self._codes, codes])

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Start the stream with sample number `index`."""
        self._utc, self._position = utc_ns, index

    def read(self, limit: int) -> SampleBlock:
        """At most `limit` of the queued samples."""
        codes, self._codes = self._codes[:limit], self._codes[limit:]
        utc = self._utc + round(self._position * 1e9 / self.form.rate)
        block = SampleBlock(codes, self._position, utc, 0, self.flags)
        self._position += len(codes)
        return block


class FullSpeedDaemon:
    """One stream through the cyclic tasks, as fast as the computer allows."""

    def __init__(self, form: StreamFormat, window: float, start_utc_ns: int) -> None:
        """`window` in s."""
        layout = RingLayout(form.rate, len(form.scale), int(2 * _CYCLES * 1e-3 * form.rate))
        self._ring, descriptor = Ring.create(layout)
        os.close(descriptor)
        self._source = _QueueSource(form)
        self._fast = FastTask(self._source, self._ring, window * form.rate, lambda: None, _NEVER_LATE)
        self._fast.start(start_utc_ns, 0)
        self._slow = SlowTask(self._ring, Meter(form, window=window), self._source.flags)
        self._samples_per_cycle = round(form.rate * CYCLE_NS * 1e-9)

    def feed(self, codes: Codes) -> Iterator[WindowBatch]:
        """Meter samples [samples, channels] of whole milliseconds."""
        self._source.put(codes)
        cycles = len(codes) // self._samples_per_cycle
        while cycles > 0:
            self._fast.cycle(min(cycles, _CYCLES))
            batch = self._slow.cycle()
            if batch is not None:
                yield batch
            cycles -= _CYCLES

    def close(self) -> None:
        """Release the ring."""
        self._ring.close()
