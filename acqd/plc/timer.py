"""A periodic kernel timer (timerfd): never early, and it counts the cycles that were missed.

Not asyncio or sleep: epoll rounds to whole milliseconds, which is the whole period here.
"""

from __future__ import annotations

import ctypes
import os
import sys
import time
from functools import lru_cache

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
        self.fd = _create()
        """Of the timer."""
        _arm(self.fd, self.due_ns + period_ns, period_ns)

    def wait(self) -> int:
        """Sleep until the next expiry; the number of periods that have passed (1: in time)."""
        expirations = int.from_bytes(os.read(self.fd, 8), sys.byteorder)
        self.due_ns += expirations * self.period_ns
        return expirations

    def shift(self, offset_ns: int) -> None:
        """Move all later expiries by `offset_ns`: phase control against another clock."""
        self.due_ns += offset_ns
        _arm(self.fd, self.due_ns + self.period_ns, self.period_ns)

    def close(self) -> None:
        """Release the timer."""
        os.close(self.fd)


def _create() -> int:
    if sys.version_info >= (3, 13):
        return os.timerfd_create(time.CLOCK_MONOTONIC, flags=os.TFD_CLOEXEC)
    fd = _libc().timerfd_create(time.CLOCK_MONOTONIC, _TFD_CLOEXEC)
    if fd < 0:
        raise OSError(ctypes.get_errno(), "timerfd_create failed")
    return int(fd)


def _arm(fd: int, first_ns: int, period_ns: int) -> None:
    """First expiry at `first_ns` on CLOCK_MONOTONIC, then every `period_ns`."""
    if sys.version_info >= (3, 13):
        os.timerfd_settime_ns(fd, flags=os.TFD_TIMER_ABSTIME, initial=first_ns, interval=period_ns)
        return
    spec = _Itimerspec(_Timespec(*divmod(period_ns, 10**9)), _Timespec(*divmod(first_ns, 10**9)))
    if _libc().timerfd_settime(fd, _TFD_TIMER_ABSTIME, ctypes.byref(spec), None):
        raise OSError(ctypes.get_errno(), "timerfd_settime failed")


@lru_cache(maxsize=1)
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)
