"""Starts MAIN_FAST, wakes MAIN_SLOW once per window, restarts what crashed."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.errors import OperationError, UserError
from acqd.metering import Meter, StreamFormat, WindowBatch
from acqd.plc.realtime import RealtimeSettings
from acqd.plc.ring import Ring, RingLayout
from acqd.plc.slow import SlowTask
from acqd.plc.stats import CycleStats, CycleSummary
from acqd.sources.base import SourceHealth
from acqd.sources.spec import Spec

_log = logging.getLogger(__name__)
_STOP_S = 1.0  # enough for a window and the exit; then the process is killed
_RESTART_S = 0.2


@dataclass(slots=True)
class _Fast:
    """One life of the fast process."""

    process: asyncio.subprocess.Process
    ring: Ring
    form: StreamFormat
    live: bool
    flags: frozenset[str]
    period_ns: int
    refused: list[str] = field(default_factory=list)


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
    ) -> None:
        self._spec = source
        self._make_meter = make_meter
        self._on_batch = on_batch
        self._window = window
        self._realtime = realtime or RealtimeSettings()
        self._fast: _Fast | None = None
        self._slow: SlowTask | None = None
        self._wake_fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._stopping = False
        self._reached: tuple[int, int, int] | None = None  # next sample's index, its UTC, seen at (monotonic) [ns]
        self.restarts = 0
        self.health = SourceHealth()
        """How the source was at the last wake-up."""
        self.meter: Meter | None = None
        self.failure: Exception | None = None

    async def start(self) -> StreamFormat:
        """Start the fast process. Raises UserError when its source cannot be used."""
        await self._launch()
        assert self._fast is not None
        asyncio.get_running_loop().add_reader(self._wake_fd, self._on_wake)
        return self._fast.form

    async def run(self) -> None:
        """Until the source ends or `stop` is called; a crash in between is restarted."""
        while True:
            assert self._fast is not None
            code = await self._fast.process.wait()
            self._drain()
            if self.failure is not None:
                raise self.failure
            if self._stopping or code == 0:
                return
            if not self._fast.live:
                raise OperationError(
                    f"MAIN_FAST died ({_how(code)}); a replay cannot be resumed in the middle, start it again"
                )
            self.restarts += 1
            _log.warning("MAIN_FAST died (%s); restarting it, the gap will be flagged", _how(code))
            await asyncio.sleep(_RESTART_S)
            if self._stopping:
                return
            await self._launch()
            if self._stopping:  # asked for while the new process started
                self._fast.process.terminate()

    async def stop(self) -> None:
        """Let the current window finish, then end the fast process."""
        self._stopping = True
        if self._fast is None or self._fast.process.returncode is not None:
            return
        self._fast.process.terminate()
        try:
            await asyncio.wait_for(self._fast.process.wait(), _STOP_S)
        except TimeoutError:
            _log.warning("MAIN_FAST did not stop in %s s; killed", _STOP_S)
            self._fast.process.kill()

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

    def slow_us(self) -> float:
        """Mean duration of MAIN_SLOW per window so far [us]."""
        if self._slow is None or not self._slow.windows:
            return 0.0
        return self._slow.busy_ns / self._slow.windows / 1000

    async def _launch(self) -> None:
        ring_fd = os.memfd_create("acqd-ring", os.MFD_CLOEXEC)
        orders = {
            "source": self._spec,
            "ring_fd": ring_fd,
            "wake_fd": self._wake_fd,
            "window": self._window,
            "realtime": asdict(self._realtime),
            "resume": self._reached,
        }
        # One BLAS thread: MAIN_FAST has no use for more, and each would be another stack to keep.
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-P",  # never a folder named acqd in the working directory
            "-m",
            "acqd.plc.process",
            json.dumps(orders),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            pass_fds=(ring_fd, self._wake_fd),
            env=environment,
        )
        try:
            assert process.stdout is not None
            line = await process.stdout.readline()
            died = {"error": "MAIN_FAST died while it started; see the log above"}
            answer: dict[str, Any] = json.loads(line) if line else died
            if "error" in answer:
                await process.wait()
                raise UserError(answer["error"])
            form = answer["form"]
            self._adopt(
                _Fast(
                    process,
                    Ring(RingLayout(**answer["layout"]), ring_fd),
                    StreamFormat(form["rate"], tuple(form["scale"]), form["f_nominal"], form["bits"]),
                    answer["live"],
                    frozenset(answer["flags"]),
                    answer["period_ns"],
                    answer["refused"],
                )
            )
        finally:
            os.close(ring_fd)

    def _adopt(self, fast: _Fast) -> None:
        if self.meter is not None and fast.form != self.meter.form:
            raise OperationError("the source has another format than before (rate, scale or phases); start again")
        previous, self._fast = self._fast, fast
        if self._slow is None:
            self.meter = self._make_meter(fast.form)
            self._slow = SlowTask(fast.ring, self.meter, fast.flags)
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

    def _watch_source(self) -> None:
        """Log when the device is lost or found; keep the counters for the status."""
        assert self._fast is not None
        health = self._fast.ring.health()
        if health is None:
            return
        if self.health.connected and not health.connected:
            _log.warning("source lost: %s; trying again", health.reason)
        elif health.connected and not self.health.connected:
            _log.warning("source is back; the gap is flagged")
        elif health.connected and health.reason and health.reason != self.health.reason:
            _log.warning("source: %s", health.reason)
        self.health = health

    def _drain(self) -> None:
        """MAIN_SLOW, and what follows it. A failure here ends the daemon: it is a bug, not an event."""
        assert self._slow is not None and self._fast is not None
        self._watch_source()
        try:
            batch = self._slow.cycle()
            reached = self._fast.ring.reached()
            if reached is not None:
                self._reached = (*reached, time.monotonic_ns())
            if batch is not None:
                self._on_batch(batch)
        except Exception as error:
            self.failure = error
            if self._fast.process.returncode is None:
                self._fast.process.terminate()


def _how(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"
