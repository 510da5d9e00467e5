"""MAIN_FAST: every cycle, take what the source has and put it into the ring. Nothing else."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from acqd.metering import SampleBlock
from acqd.metering.block import Codes
from acqd.plc.clock import StepDetector
from acqd.plc.ring import ENDED, FLAGS, GAP, LATE, SOURCE_FLAGS, STEP, STOPPED, Ring
from acqd.plc.stats import CycleStats
from acqd.plc.ticks import make_ticks
from acqd.sources.base import Source

_ROOM = 0.25  # share of the ring that one cycle may fill: MAIN_SLOW has time to take the rest


@dataclass(frozen=True, slots=True)
class OverrunPolicy:
    """What happens after missed cycles."""

    catch_up_ns: int = 200_000_000
    """Samples of a stall up to this long are all caught up at once, and their windows flagged
    `late`; of a longer one the rest is given up and the row flagged `gap`."""
    late_ns: int = 10_000_000
    """A shorter stall than this is not worth a flag: every sample is there, in time for its window."""


class FastTask:
    """One cycle's work, without its timer: what to read, what to write, what to flag."""

    def __init__(
        self,
        source: Source,
        ring: Ring,
        window_samples: float,
        wake: Callable[[], None],
        policy: OverrunPolicy | None = None,
        wake_fd: int | None = None,
    ) -> None:
        """`wake` is called once per completed window of `window_samples`; `wake_fd` is an eventfd for the same."""
        self._wake_fd = wake_fd
        self._source = source
        self._ring = ring
        self._rate = source.form.rate
        self._policy = policy or OverrunPolicy()
        self._per_ns = self._rate * 1e-9
        self._period_ns = source.period_ns
        self._room = int(_ROOM * ring.layout.capacity)
        self._per_window = window_samples
        self._wake = wake
        self.patience_ns = round(2e9 * window_samples / self._rate) + source.period_ns
        """Longest wait for a whole window [ns]."""
        self._steps = StepDetector(round(1e9 * window_samples / self._rate))
        self._elapsed_ns = 0
        self._read = 0  # samples asked for so far: elapsed time in samples
        self._expected = 0  # stream index of the next sample
        self.windows = 0
        """Windows completed, in numbers of the stream's grid."""
        self._window_end = 0
        self._anchor = (0, 0)
        self._flags: frozenset[str] = frozenset()  # of the source's last block
        self.stopping = False
        """The end is near: the window in progress is the last one."""
        self._flowing = False  # a block was written: its flags are those of the samples ahead
        self._health = source.health()

    def start(self, utc_ns: int, index: int) -> None:
        """Open the source; its first sample is number `index`, now."""
        self._source.open(utc_ns, index)
        self._ring.report(self._health)
        if self._source.paced:
            first = self._source.read(0)
            self._begin(index, first.utc_ns if first is not None else utc_ns)

    def _begin(self, index: int, utc_ns: int) -> None:
        """The stream begins: at once for a paced source, with the first block for a device."""
        self._expected = index
        self._count_windows()
        self._anchor = (index, utc_ns)
        self._ring.begin(index, utc_ns)

    def constants(self) -> dict[str, float]:
        """What cycles in C need to know (`ticks.c`); a live source has its clock checked at every window."""
        wake = self._wake_fd if self._wake_fd is not None and not self._source.live else -1
        return {
            "late_ns": self._policy.late_ns, "per_ns": self._per_ns, "per_window": self._per_window, "wake": wake,
        }  # fmt: skip

    @property
    def pace(self) -> tuple[int, int, int, int]:
        """Time so far [ns], samples that it was worth, number of the next sample, whole windows."""
        return self._elapsed_ns, self._read, self._expected, self.windows

    def ahead(self) -> Codes | None:
        """Samples that may be written as they become due, without a cycle of this task; None: there are none."""
        if not (self._source.paced and self._flowing) or self.stopping:
            return None
        return self._source.ahead(self._room)

    def wrote(self, samples: int, elapsed_ns: int, windows: int) -> None:
        """The first of those samples are in the ring; the other numbers are as in `pace`."""
        self._source.skip(samples)
        self._elapsed_ns, self._read = elapsed_ns, self._read + samples
        self._expected += samples
        if windows > self.windows:
            self._count_windows()

    def cycle(self, expirations: int) -> bool:
        """One wake-up after `expirations` periods. False when the source has ended."""
        stall_ns = expirations * self._period_ns
        late = stall_ns - self._period_ns >= self._policy.late_ns
        self._source.exchange()
        going = self._take_due(stall_ns, late) if self._source.paced else self._take_all(late)
        self._report()
        return going

    def _take_due(self, stall_ns: int, late: bool) -> bool:
        """From a paced source: the samples that the elapsed time is worth. False when it has ended."""
        block = self._source.read(self._due(stall_ns))
        if block is not None:
            self._write(block, late)
        return block is not None

    def _take_all(self, late: bool) -> bool:
        """From a device: block by block what it has, as much as MAIN_SLOW can follow."""
        room = self._room
        while room > 0:
            block = self._source.read(room)
            if block is None:
                return False
            if not len(block.codes):
                break
            self._write(block, late)
            room -= len(block.codes)
            late = False
        return True

    def _due(self, stall_ns: int) -> int:
        """Samples that the elapsed time is worth; the excess of a stall that is too long is given up."""
        self._elapsed_ns += stall_ns
        due = int(self._elapsed_ns * self._per_ns) - self._read
        self._read += due
        if stall_ns > self._policy.catch_up_ns:
            given_up = due - int(self._policy.catch_up_ns * 1e-9 * self._rate)
            self._source.skip(given_up)
            due -= given_up
        return due

    def _report(self) -> None:
        """Pass a change of the source's health on; a lost or found device, or a warning, also wakes MAIN_SLOW."""
        health = self._source.health()
        if health == self._health:
            return
        turned = (health.connected, health.reason) != (self._health.connected, self._health.reason)
        self._health = health
        self._ring.report(health)
        if turned:
            self._wake()

    def _write(self, block: SampleBlock, late: bool) -> None:
        if not self._ring.state:
            self._begin(block.index, block.utc_ns)
        if late:
            self._ring.event(LATE)
        gap = block.index - self._expected
        if gap:
            self._ring.event(GAP, gap)
        if block.flags != self._flags and len(block.codes):
            self._flags = block.flags
            self._ring.event(FLAGS, sum(1 << SOURCE_FLAGS.index(name) for name in block.flags))
        self._ring.write(block.codes)
        self._flowing = len(block.codes) > 0
        self._expected = block.index + len(block.codes)
        if self._expected >= self._window_end:
            self._count_windows()
            if self._source.live:
                self._check_clock()
            self._wake()

    def _count_windows(self) -> None:
        """Window k ends at sample floor(k * N + 1/2), as on the meter's grid."""
        self.windows = math.ceil((self._expected + 0.5) / self._per_window) - 1
        self._window_end = math.floor((self.windows + 1) * self._per_window + 0.5)

    def _check_clock(self) -> None:
        index, utc_ns = self._anchor
        stream_ns = utc_ns + round((self._expected - index) * 1e9 / self._rate)
        offset = self._steps.check(time.time_ns(), stream_ns)
        if offset is not None:
            self._anchor = (self._expected, stream_ns + offset)
            self._ring.event(STEP, stream_ns + offset)


def run_fast(
    task: FastTask,
    source: Source,
    ring: Ring,
    *,
    utc_ns: int,
    index: int,
    stop: Callable[[], bool],
    library: str | None = None,
) -> None:
    """The cyclic loop, until the source ends or the first whole window after `stop()` turns true.

    A device that completes no window in the time of two does not delay the end.

    `library` holds the cycles in C. How late each wake-up was and how long the cycle worked is counted in the ring.
    """
    CycleStats(ring.cycle_slots, source.period_ns).clear()
    task.start(utc_ns, index)
    ticks = make_ticks(task, ring, source.period_ns, library)
    state = STOPPED
    last_window: int | None = None
    last_ns = 0
    try:
        while last_window is None or (task.windows <= last_window and time.monotonic_ns() < last_ns):
            expirations = ticks.wait()
            if expirations and not task.cycle(expirations):
                state = ENDED
                break
            if last_window is None and stop():
                last_window, last_ns = task.windows, time.monotonic_ns() + task.patience_ns
                task.stopping = True
            correction = source.correction_ns()
            if correction:
                ticks.shift(correction)
    finally:
        ticks.close()
        ring.finish(state)
