"""Device notifications: the PLC samples a variable in its cycle and sends the samples in batches."""

from __future__ import annotations

import asyncio
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from tests.doubles.ads.memory import PlcMemory
from tests.doubles.ads.wire import AdsError, Code, Frame

_REQUEST = struct.Struct("<6I")
_STREAM = struct.Struct("<II")
_STAMP = struct.Struct("<QI")
_SAMPLE = struct.Struct("<II")
_FILETIME_EPOCH_UNIX_NS = -11_644_473_600 * 10**9
"""1601-01-01 in Unix time [ns]."""


class Mode(IntEnum):
    """ADSTRANSMODE."""

    CYCLIC = 3
    ON_CHANGE = 4


@dataclass(frozen=True)
class Attributes:
    """AddDeviceNotification: times in units of 100 ns on the wire, here in s."""

    group: int
    offset: int
    length: int
    mode: Mode
    max_delay: float
    cycle_time: float


def parse_attributes(data: bytes) -> Attributes:
    """Raises AdsError 0x705 or 0x706."""
    if len(data) < _REQUEST.size:
        raise AdsError(Code.INVALID_SIZE)
    group, offset, length, mode, max_delay, cycle_time = _REQUEST.unpack_from(data)
    try:
        return Attributes(group, offset, length, Mode(mode), max_delay * 1e-7, cycle_time * 1e-7)
    except ValueError:
        raise AdsError(Code.INVALID_DATA) from None


class Notification:
    """One subscription. Values are computed for every cycle time that has passed, also if the timer is late."""

    def __init__(
        self,
        handle: int,
        wanted: Attributes,
        request: Frame,
        memory: PlcMemory,
        send: Callable[[Frame], None],
        *,
        task_cycle: float,
    ) -> None:
        self.handle = handle
        self._wanted = wanted
        self._request = request
        self._memory = memory
        self._send = send
        self._cycle = max(wanted.cycle_time, task_cycle)
        self._next = time.monotonic()
        self._last_value: bytes | None = None
        self._timer = self._schedule()

    def cancel(self) -> None:
        self._timer.cancel()

    def _schedule(self) -> asyncio.TimerHandle:
        return asyncio.get_running_loop().call_later(max(self._wanted.max_delay, self._cycle), self._flush)

    def _flush(self) -> None:
        """Send the samples of all cycles since the last flush, then wait for the next."""
        self._timer = self._schedule()
        stamps = self._sample(time.monotonic())
        if stamps:
            body = b"".join(stamps)
            stream = _STREAM.pack(4 + len(body), len(stamps)) + body
            self._send(self._request.notification(stream))

    def _sample(self, now: float) -> list[bytes]:
        """Stamps with one sample each, of the cycles up to `now` [s of time.monotonic]."""
        stamps = []
        while self._next <= now:
            value = self._value(self._next)
            if value is not None and (self._wanted.mode == Mode.CYCLIC or value != self._last_value):
                stamps.append(self._stamp(self._next, value))
            self._last_value = value
            self._next += self._cycle
        return stamps

    def _value(self, at: float) -> bytes | None:
        """The variable's bytes; None after the variable has been removed."""
        try:
            return self._memory.read(self._wanted.group, self._wanted.offset, self._wanted.length, at, observe=True)
        except AdsError:
            return None

    def _stamp(self, at: float, value: bytes) -> bytes:
        """AdsStampHeader (FILETIME) with one AdsNotificationSample."""
        unix_ns = time.time_ns() - round((time.monotonic() - at) * 1e9)
        return (
            _STAMP.pack((unix_ns - _FILETIME_EPOCH_UNIX_NS) // 100, 1) + _SAMPLE.pack(self.handle, len(value)) + value
        )
