"""One life of the process that MAIN_FAST runs in: started, watched for signs of life, ended."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from acqd.errors import UserError
from acqd.metering import StreamFormat
from acqd.plc.ring import Ring, RingLayout
from acqd.retry import Heartbeat

_STOP_S = 1.0  # enough for a window and the exit; then the process is killed
_STARTING_S = 60.0  # for a device that takes its time; a process that is stopped meanwhile is noticed at once
_STOPPED_S = 1.0  # in the state T (SIGSTOP): no wait for a device looks like that
_LOOK_S = 0.25


class StartError(Exception):
    """MAIN_FAST died or hung before it had reached its source; one line. Worth another try."""

    def __init__(self, message: str, *, exited: bool = False) -> None:
        """`exited`: it ended by itself, nobody killed it."""
        super().__init__(message)
        self.exited = exited


class Process(Protocol):
    """What is used of asyncio's Process."""

    pid: int
    stdout: asyncio.StreamReader | None

    @property
    def returncode(self) -> int | None:
        """None while it runs."""

    async def wait(self) -> int:
        """Its exit code."""

    def terminate(self) -> None:
        """SIGTERM."""

    def kill(self) -> None:
        """SIGKILL."""


Spawn = Callable[[dict[str, Any], int, int], Awaitable[Process]]
"""Starts a process with orders and the descriptors of ring and wake-up; its answer is on its stdout."""


@dataclass(slots=True)
class FastProcess:
    """A process that cycles."""

    process: Process
    ring: Ring
    form: StreamFormat
    live: bool
    flags: frozenset[str]
    period_ns: int
    patience_s: float
    """Longest time between two cycles [s]; after that the process hangs."""
    refused: list[str] = field(default_factory=list)
    begun: float = field(default_factory=time.monotonic)

    async def outlive(self) -> str:
        """Wait for the end of the process, or kill it when it hangs; says which, in words."""
        ended = asyncio.ensure_future(self.process.wait())
        cycles, stopped = Heartbeat(self.patience_s, _LOOK_S), Heartbeat(_STOPPED_S, _LOOK_S)
        while True:
            await asyncio.wait({ended}, timeout=_LOOK_S)
            if ended.done():
                return how(ended.result())
            runs = stopped.check(None if is_stopped(self.process.pid) else object())
            if cycles.check(self.ring.beats) and runs:
                continue
            self.kill()
            await ended
            return f"hung for {max(cycles.silent_s, stopped.silent_s):.1f} s, killed"

    async def stop(self) -> bool:
        """Let the current window finish, then end the process; whether it ended by itself."""
        if self.process.returncode is not None:
            return True
        self.process.terminate()
        try:
            await asyncio.wait_for(self.process.wait(), _STOP_S)
        except TimeoutError:
            self.kill()
            return False
        return True

    def kill(self) -> None:
        """End the process now."""
        _kill(self.process)

    def terminate(self) -> None:
        """Ask the process to end."""
        with contextlib.suppress(ProcessLookupError):
            self.process.terminate()


async def launch(orders: dict[str, Any], wake_fd: int, spawn: Spawn | None = None) -> FastProcess:
    """Start MAIN_FAST with `orders` (see acqd.plc.process) and wait until its source is reached.

    Raises UserError when the source cannot be used, StartError when the process dies or hangs. A cancelled launch
    leaves no process behind.
    """
    ring_fd = os.memfd_create("acqd-ring", os.MFD_CLOEXEC)
    try:
        process = await (spawn or spawn_interpreter)(orders, ring_fd, wake_fd)
        try:
            return _fast(process, await _answer(process), ring_fd)
        except BaseException:
            _kill(process)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), _STOP_S)
            raise
    finally:
        os.close(ring_fd)


async def spawn_interpreter(orders: dict[str, Any], ring_fd: int, wake_fd: int) -> Process:
    """A fresh interpreter."""
    return await asyncio.create_subprocess_exec(
        *interpreter("acqd.plc.process", json.dumps(orders | {"ring_fd": ring_fd, "wake_fd": wake_fd})),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        pass_fds=(ring_fd, wake_fd),
        env=environment(),
    )


def interpreter(module: str, argument: str) -> tuple[str, ...]:
    """Command line; -P: never a folder named acqd in the working directory."""
    return sys.executable, "-P", "-m", module, argument


def environment() -> dict[str, str]:
    """One BLAS thread: MAIN_FAST has no use for more, and each would be another stack to keep."""
    return os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


async def _answer(process: Process) -> dict[str, Any]:
    """The line that a process prints when it has reached its source. Raises like `launch`."""
    assert process.stdout is not None
    reading = asyncio.ensure_future(process.stdout.readline())
    starts, runs = Heartbeat(_STARTING_S, _LOOK_S), Heartbeat(_STOPPED_S, _LOOK_S)
    try:
        while not reading.done():
            await asyncio.wait({reading}, timeout=_LOOK_S)
            if not (starts.check(None) and runs.check(None if is_stopped(process.pid) else object())):
                raise StartError("it hung while it started")
    finally:
        reading.cancel()
    line = reading.result()
    if not line.endswith(b"\n"):  # nothing, or what a killed process had written of its answer
        code = await process.wait()
        raise StartError(f"it died while it started ({how(code)})", exited=code >= 0)
    answer: dict[str, Any] = json.loads(line)
    if "error" in answer:
        await process.wait()
        raise UserError(answer["error"])
    return answer


def _fast(process: Process, answer: dict[str, Any], ring_fd: int) -> FastProcess:
    form = answer["form"]
    return FastProcess(
        process,
        Ring(RingLayout(**answer["layout"]), ring_fd),
        StreamFormat(form["rate"], tuple(form["scale"]), form["f_nominal"], form["bits"]),
        answer["live"],
        frozenset(answer["flags"]),
        answer["period_ns"],
        answer["patience_s"],
        answer["refused"],
    )


def _kill(process: Process) -> None:
    with contextlib.suppress(ProcessLookupError):
        process.kill()


def is_stopped(pid: int) -> bool:
    """Whether the kernel has stopped the process (SIGSTOP; proc(5), field 3 of stat)."""
    try:
        stat = os.open(f"/proc/{pid}/stat", os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        return os.read(stat, 4096).rpartition(b")")[2].split()[0] == b"T"
    except OSError:  # it has just ended
        return False
    finally:
        os.close(stat)


def how(code: int) -> str:
    """The end of a process in words."""
    return f"signal {-code}" if code < 0 else f"exit code {code}"
