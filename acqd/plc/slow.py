"""MAIN_SLOW: once per window, take the ring's samples and meter them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from acqd.metering import Meter, SampleBlock, WindowBatch
from acqd.metering.stages import Stages
from acqd.plc.distribution import Durations
from acqd.plc.ring import Ring


class SlowTask:
    """Turns the ring's samples into window quantities; its own duration is kept for the status."""

    def __init__(
        self,
        ring: Ring,
        meter: Meter,
        flags: frozenset[str] = frozenset(),
        stages: Stages | None = None,
        watches: Sequence[Callable[[SampleBlock], None]] = (),
        keep: Callable[[list[SampleBlock]], None] | None = None,
    ) -> None:
        """`meter` takes the samples as `stages` leave them, and then `watches` do.

        `keep` gets all blocks of a cycle before the first of them is metered.
        """
        self._ring = ring
        self._meter = meter
        self._stages = stages
        self._watches, self._keep = watches, keep
        self.flags = flags
        """Hold for the rows made from now on ("simulated")."""
        self.windows = 0
        self.busy_ns = 0
        self.durations = Durations()
        """Of the cycles that completed windows."""

    def replace_ring(self, ring: Ring) -> None:
        """Continue with a restarted MAIN_FAST; the samples in between are a gap."""
        self._ring = ring

    def cycle(self) -> WindowBatch | None:
        """Meter what has arrived; None when no window is complete."""
        begun = time.perf_counter_ns()
        batches = []
        blocks = self._ring.read()
        if self.flags:
            blocks = [replace(block, flags=block.flags | self.flags) for block in blocks]
        if blocks and self._keep is not None:
            self._keep(blocks)
        for block in blocks:
            ready = block if self._stages is None else self._stages.apply(block)
            batch = None if ready is None else self._meter.feed(ready)
            if ready is not None:
                for watch in self._watches:
                    watch(ready)
            if batch is not None:
                batches.append(batch)
        if not batches:
            return None
        joined = WindowBatch.join(batches)
        self.windows += len(joined)
        busy_ns = time.perf_counter_ns() - begun
        self.busy_ns += busy_ns
        self.durations.add(busy_ns)
        return joined
