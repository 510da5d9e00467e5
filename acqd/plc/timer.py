"""A periodic kernel timer (timerfd): never early, and it counts the cycles that were missed.

Not asyncio or sleep: epoll rounds to whole milliseconds, which is the whole period here.
"""

from __future__ import annotations

import ctypes
import os
import sys
import time

_TFD_CLOEXEC = os.O_CLOEXEC
_TFD_TIMER_ABSTIME = 1


class _Timespec(ctypes.Structure):
    _fields_ = (("sec", ctypes.c_long), ("nsec", ctypes.c_long))


class _Itimerspec(ctypes.Structure):
    _fields_ = (("interval", _Timespec), ("value", _Timespec))


class PeriodicTimer:
    """Expires every `period_ns` on CLOCK_MONOTONIC, first one period after it is made."""

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.due_ns = time.monotonic_ns()
        """CLOCK_MONOTONIC at which the last awaited expiry was due [ns]."""
        self._fd = _create(self.due_ns + period_ns, period_ns)

    def wait(self) -> int:
        """Sleep until the next expiry; the number of periods that have passed (1: in time)."""
        expirations = int.from_bytes(os.read(self._fd, 8), sys.byteorder)
        self.due_ns += expirations * self.period_ns
        return expirations

    def close(self) -> None:
        """Release the timer."""
        os.close(self._fd)


def _create(first_ns: int, period_ns: int) -> int:
    if sys.version_info >= (3, 13):
        fd = os.timerfd_create(time.CLOCK_MONOTONIC, flags=os.TFD_CLOEXEC)
        os.timerfd_settime_ns(fd, flags=os.TFD_TIMER_ABSTIME, initial=first_ns, interval=period_ns)
        return fd
    libc = ctypes.CDLL(None, use_errno=True)
    fd = libc.timerfd_create(time.CLOCK_MONOTONIC, _TFD_CLOEXEC)
    if fd < 0:
        raise OSError(ctypes.get_errno(), "timerfd_create failed")
    spec = _Itimerspec(_Timespec(*divmod(period_ns, 10**9)), _Timespec(*divmod(first_ns, 10**9)))
    if libc.timerfd_settime(fd, _TFD_TIMER_ABSTIME, ctypes.byref(spec), None):
        raise OSError(ctypes.get_errno(), "timerfd_settime failed")
    return int(fd)
