"""Starts MAIN_FAST, wakes MAIN_SLOW once per window, relaunches what has died or hangs.

A live source is metered for as long as the daemon runs: MAIN_FAST is relaunched for ever, whatever ends it, and the
windows lost are a gap in the rows.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from acqd.changes import StateLog
from acqd.errors import OperationError, UserError
from acqd.metering import Meter, SampleBlock, StreamFormat, WindowBatch
from acqd.metering.stages import Stage, Stages
from acqd.plc.distribution import Distribution, of_microseconds
from acqd.plc.fast_process import FastProcess, Spawn, StartError, launch
from acqd.plc.kernel_clock import KernelClock
from acqd.plc.realtime import RealtimeSettings
from acqd.plc.recent import RecentSamples
from acqd.plc.ring import ENDED
from acqd.plc.slow import SlowTask
from acqd.plc.source_watch import SourceWatch
from acqd.plc.stats import CycleStats, CycleSummary
from acqd.plc.ticks_library import library_path
from acqd.retry import Backoff, RetryPolicy
from acqd.sources.base import SourceHealth
from acqd.sources.spec import Spec

_log = logging.getLogger(__name__)
_RELAUNCH = RetryPolicy(first_s=0.2, longest_s=2.0, stable_s=2.0)
MakeKeeper = Callable[[StreamFormat, Stages, Meter], Callable[[list[SampleBlock]], None]]
"""Gets the format of the source, and the stages and the meter, whose state belongs to the next block."""


class Executive:
    """MAIN_FAST and MAIN_SLOW of one source; rows go to `on_batch`."""

    def __init__(
        self,
        source: Spec,
        make_meter: Callable[[StreamFormat], Meter],
        on_batch: Callable[[WindowBatch], None],
        *,
        window: float = 0.04,
        realtime: RealtimeSettings | None = None,
        makers: Sequence[Callable[[StreamFormat], Stage | None]] = (),
        make_watch: Callable[[StreamFormat], Callable[[SampleBlock], None]] | None = None,
        make_keeper: MakeKeeper | None = None,
        before_meter: Callable[[], Awaitable[None]] | None = None,
        of: str = "",
        spawn: Spawn | None = None,
    ) -> None:
        """`makers` make the stages before the meter; `make_meter` gets the format after them.

        So does `make_watch`, which makes what gets every block after the meter. `make_keeper` makes what gets
        all blocks of a cycle as the source delivers them, before they are metered. `before_meter` is awaited before
        the meter is made: samples wait in the ring, which holds seconds of them. `of` names the device in the log
        where there are several. `spawn` starts the process of MAIN_FAST; None: in a fresh interpreter.
        """
        self._spawn = spawn
        self._orders = {"source": source, "window": window, "realtime": asdict(realtime or RealtimeSettings())}
        self._make_meter, self._makers = make_meter, makers
        self._form: StreamFormat | None = None
        self._window = window
        self._on_batch = on_batch
        self._make_watch, self._make_keeper = make_watch, make_keeper
        self._before_meter = before_meter
        self._fast: FastProcess | None = None
        self._slow: SlowTask | None = None
        self._wake_fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._stopping = asyncio.Event()
        self._starting: asyncio.Task[None] | None = None
        self._reached: tuple[int, int, int] | None = None  # next sample's index, its UTC, due at (monotonic) [ns]
        self._backoff = Backoff(_RELAUNCH)
        self._of = f" of {of}" if of else ""
        self._says = StateLog(_log, of=of)
        self._source = SourceWatch(self._says)
        self.restarts = 0
        self.relaunching = False
        """Whether MAIN_FAST is gone and being launched again."""
        self.clock = KernelClock()
        self.meter: Meter | None = None
        self.recent: RecentSamples | None = None
        """The newest samples, for readers in any thread; None before the start."""
        self.failure: Exception | None = None

    async def start(self) -> StreamFormat:
        """Start the fast process. Raises UserError when its source cannot be used."""
        while self._fast is None:
            try:
                await self._launch()
            except StartError as error:
                if error.exited:  # a bug or a broken installation: trying again changes nothing
                    raise UserError(f"MAIN_FAST: {error}; see the log above") from None
                self._says.trouble("MAIN_FAST", "start", f"{error}; starting it again")
                await self._pause()
        asyncio.get_running_loop().add_reader(self._wake_fd, self._on_wake)
        return self._fast.form

    async def run(self) -> None:
        """Until the source ends or `stop` is called; what dies or hangs in between is relaunched.

        Raises OperationError when that cannot be: a recording, or a source with another format than before.
        """
        while True:
            assert self._fast is not None
            end = await self._fast.outlive()
            self._drain()
            if self.failure is not None:
                raise self.failure
            if self._stopping.is_set() or self._fast.ring.state == ENDED:
                return
            if not self._fast.live:
                raise OperationError(
                    f"MAIN_FAST died ({end}); a replay cannot be resumed in the middle, start it again"
                )
            self._says.trouble("MAIN_FAST", "gone", f"{end}; relaunching it, the gap will be flagged")
            self._backoff.ended(time.monotonic() - self._fast.begun)
            self.relaunching = True
            if not await self._relaunch():
                return
            self.relaunching = False

    async def _relaunch(self) -> bool:
        """Launch again and again; False when `stop` is called meanwhile."""
        while not self._stopping.is_set():
            await self._pause()
            if self._stopping.is_set():
                break
            self.restarts += 1
            self._starting = asyncio.create_task(self._launch())
            try:
                await self._starting
            except asyncio.CancelledError:
                if not self._stopping.is_set():
                    raise
            except (StartError, UserError, OSError) as error:
                self._says.trouble("MAIN_FAST", f"not relaunched: {type(error).__name__}", f"{error}; trying again")
                self._source.lose(str(error))
            else:
                return True
        return False

    async def _pause(self) -> None:
        """Before the next launch; a stop ends the pause."""
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._stopping.wait(), self._backoff.pause_s())

    async def stop(self) -> None:
        """Let the current window finish, then end the fast process."""
        self._stopping.set()
        if self._starting is not None:
            self._starting.cancel()
        if self._fast is not None and not await self._fast.stop():
            _log.warning("MAIN_FAST%s did not stop in time; killed", self._of)

    def close(self) -> None:
        """Release descriptors."""
        asyncio.get_running_loop().remove_reader(self._wake_fd)
        os.close(self._wake_fd)
        if self._fast is not None:
            self._fast.ring.close()

    @property
    def refused(self) -> list[str]:
        """Real-time settings this host refused, as sentences."""
        return self._fast.refused if self._fast else []

    @property
    def health(self) -> SourceHealth:
        """How the source was at the last wake-up."""
        return self._source.health

    @property
    def flags(self) -> frozenset[str]:
        """Row flags of the whole stream."""
        return self._fast.flags if self._fast else frozenset()

    @property
    def fast_pid(self) -> int | None:
        """Process id of MAIN_FAST."""
        return self._fast.process.pid if self._fast else None

    @property
    def period_ns(self) -> int:
        """Cycle of MAIN_FAST [ns], as its source asks for."""
        assert self._fast is not None
        return self._fast.period_ns

    def cycle_summary(self) -> CycleSummary:
        """Statistics of the current fast process."""
        assert self._fast is not None
        return CycleStats(self._fast.ring.cycle_slots, self._fast.period_ns).summary()

    def cycle_histogram(self) -> NDArray[np.int64]:
        """Wake-ups of the current fast process per microsecond of latency."""
        assert self._fast is not None
        return CycleStats(self._fast.ring.cycle_slots, self._fast.period_ns).histogram()

    def latencies(self) -> Distribution:
        """How late the current fast process woke."""
        summary = self.cycle_summary()
        return of_microseconds(self.cycle_histogram(), summary.mean_us * summary.cycles)

    def durations(self) -> Distribution | None:
        """How long MAIN_SLOW took per wake-up; None before the start."""
        return self._slow.durations.distribution() if self._slow is not None else None

    def newest(self, seconds: float) -> tuple[SampleBlock, StreamFormat] | None:
        """The newest samples as the meter gets them, without a gap; in the event loop only."""
        if self._fast is None:
            return None
        block = self._fast.ring.recent(round(seconds * self._fast.form.rate))
        stages = Stages(self._fast.form, self._makers)  # other stages: the meter's are in mid-stream
        ready = None if block is None else stages.apply(replace(block, flags=block.flags | self._fast.flags))
        return None if ready is None else (ready, stages.form)

    def slow_us(self) -> float:
        """Mean duration of MAIN_SLOW per window so far [us]."""
        if self._slow is None or not self._slow.windows:
            return 0.0
        return self._slow.busy_ns / self._slow.windows / 1000

    async def _launch(self) -> None:
        fast = await launch(
            self._orders | {"resume": self._reached, "ticks": library_path()}, self._wake_fd, self._spawn
        )
        if self._form is not None and fast.form != self._form:
            fast.kill()
            raise OperationError("the source has another format than before (rate, scale or phases); start again")
        if self._slow is None and self._before_meter is not None:
            try:
                await self._before_meter()
            except BaseException:
                fast.kill()
                await fast.process.wait()
                raise
        previous, self._fast = self._fast, fast
        if self._slow is None:
            self._form = fast.form
            stages = Stages(fast.form, self._makers)
            self.meter = self._make_meter(stages.form)
            watch = self._make_watch(stages.form) if self._make_watch is not None else None
            self.recent = RecentSamples(stages.form, self._window)
            watches = [self.recent.add, *([watch] if watch is not None else [])]
            keep = self._make_keeper(fast.form, stages, self.meter) if self._make_keeper is not None else None
            self._slow = SlowTask(fast.ring, self.meter, fast.flags, stages, watches, keep)
        else:
            self._slow.replace_ring(fast.ring)
        if previous is not None:
            previous.ring.close()

    def _on_wake(self) -> None:
        try:
            os.eventfd_read(self._wake_fd)
        except BlockingIOError:
            return
        self._drain()

    def _drain(self) -> None:
        """MAIN_SLOW, and what follows it. A failure here ends the daemon: it is a bug, not an event."""
        assert self._slow is not None and self._fast is not None
        self._source.update(self._fast.ring.health())
        if self._fast.live:
            self._slow.flags = self._fast.flags | self.clock.flags()
        try:
            batch = self._slow.cycle()
            self._reached = self._fast.ring.reached() or self._reached
            if batch is not None:
                self._says.fine("MAIN_FAST", "delivers again")
                self._on_batch(batch)
        except Exception as error:
            self.failure = error
            self._fast.terminate()
