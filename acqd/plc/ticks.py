"""The cycles of MAIN_FAST: wait for the next one that needs Python, and count how punctual they are.

In C (`ticks.c`) a wake-up costs little more than what the kernel takes, and most cycles of a recording need no Python.
Without a compiler, every cycle is served in Python.
"""

from __future__ import annotations

import ctypes
import time
from typing import TYPE_CHECKING, Any, Protocol

from acqd.metering.block import Codes
from acqd.plc.ring import Ring
from acqd.plc.stats import BINS, CycleStats
from acqd.plc.timer import PeriodicTimer

if TYPE_CHECKING:
    from acqd.plc.fast import FastTask


class Ticks(Protocol):
    """Wake-ups of one task."""

    def wait(self) -> int:
        """End the cycle before and sleep until the next one that needs Python; how many periods have passed.

        0: a signal has come, and there is no cycle.
        """

    def shift(self, offset_ns: int) -> None:
        """Move all later cycles by `offset_ns`."""

    def close(self) -> None:
        """End the last cycle and release the timer."""


def make_ticks(task: FastTask, ring: Ring, period_ns: int, library: str | None) -> Ticks:
    """The cycles of a task that has started; `library`: a file from `ticks_library`."""
    if library is None:
        return PythonTicks(ring, period_ns)
    return CompiledTicks(task, ring, period_ns, library)


class PythonTicks:
    """Every cycle in Python."""

    def __init__(self, ring: Ring, period_ns: int) -> None:
        self._timer, self._ring = PeriodicTimer(period_ns), ring
        self._stats = CycleStats(ring.cycle_slots, period_ns)
        self._woke_ns = self._expirations = 0

    def wait(self) -> int:
        """The next cycle."""
        self._note()
        self._expirations = self._timer.wait()
        self._woke_ns = time.monotonic_ns()
        return self._expirations

    def shift(self, offset_ns: int) -> None:
        """Move all later cycles."""
        self._note()
        self._timer.shift(offset_ns)

    def close(self) -> None:
        """Count the last cycle."""
        self._note()
        self._timer.close()

    def _note(self) -> None:
        if self._expirations:
            now = time.monotonic_ns()
            self._stats.record(self._woke_ns - self._timer.due_ns, self._expirations, now - self._woke_ns)
            self._ring.beat()
            self._expirations = 0


class _State(ctypes.Structure):
    """`struct ticks`."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("timer", "period_ns", "bins", "capacity", "sample_bytes", "late_ns")),
        *((name, ctypes.c_void_p) for name in ("counters", "head", "taken", "beats", "ring")),
        ("wake", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("per_ns", "per_window")),
        ("ahead", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("available", "expected", "windows", "elapsed_ns", "read", "written")),
        *((name, ctypes.c_int64) for name in ("due_ns", "woke_ns", "working")),
    )


class CompiledTicks:
    """Cycles in C, as far as they need no Python."""

    def __init__(self, task: FastTask, ring: Ring, period_ns: int, library: str) -> None:
        """Raises RuntimeError for a library of another version."""
        loaded: Any = ctypes.CDLL(library)
        loaded.acqd_ticks_bytes.restype = loaded.acqd_wait.restype = ctypes.c_int64
        loaded.acqd_wait.argtypes = [ctypes.c_void_p]
        if loaded.acqd_ticks_bytes() != ctypes.sizeof(_State):
            raise RuntimeError(f"{library}: another layout than this version's")
        loaded.acqd_end.argtypes, loaded.acqd_end.restype = [ctypes.c_void_p], None
        self._wait, self._end = loaded.acqd_wait, loaded.acqd_end
        self._task, self._dtype = task, ring.codes.dtype
        self._timer = PeriodicTimer(period_ns)
        self._ahead: Codes | None = None  # keeps the samples alive while C has their address
        self._state = _State(
            timer=self._timer.fd,
            period_ns=period_ns,
            bins=BINS,
            capacity=ring.layout.capacity,
            sample_bytes=ring.codes.strides[0],
            **ring.addresses(),
            **task.constants(),
            due_ns=self._timer.due_ns,
        )
        self._address = ctypes.addressof(self._state)

    def wait(self) -> int:
        """The next cycle that needs Python."""
        state, ahead = self._state, self._task.ahead()
        if ahead is None or ahead.dtype != self._dtype or not ahead.flags.c_contiguous:
            state.available = 0
            return self._wake()
        self._ahead = ahead
        state.ahead, state.available, state.written = ahead.ctypes.data, len(ahead), 0
        state.elapsed_ns, state.read, state.expected, state.windows = self._task.pace
        expirations = self._wake()
        if state.written:
            self._task.wrote(state.written, state.elapsed_ns, state.windows)
        return expirations

    def _wake(self) -> int:
        expirations = int(self._wait(self._address))
        if expirations < 0:
            raise OSError("the timer of MAIN_FAST cannot be read")
        return expirations

    def shift(self, offset_ns: int) -> None:
        """Move all later cycles."""
        self._end(self._address)
        self._timer.due_ns = self._state.due_ns
        self._timer.shift(offset_ns)
        self._state.due_ns = self._timer.due_ns

    def close(self) -> None:
        """Count the last cycle."""
        self._end(self._address)
        self._timer.close()
