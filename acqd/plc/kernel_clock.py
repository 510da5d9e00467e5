"""Whether the kernel holds this computer's clock for synchronised (adjtimex(2)).

NTP and PTP daemons (chrony, ntpd, systemd-timesyncd, phc2sys) clear STA_UNSYNC while they discipline the clock. The
kernel sets it again when nobody has for so long that the estimated error exceeds 16 s.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

from acqd.plc.clock import STEP_NS

UNSYNCHRONISED = "unsynchronised"
"""Row flag: nobody disciplines the clock that the row's time is from."""
_STA_UNSYNC = 0x0040
_TIME_ERROR = 5
_LOOK_S = 1.0


class _Timex(ctypes.Structure):
    """struct timex as far as it is read here; with modes = 0 the call changes nothing and needs no privilege."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        *((name, ctypes.c_long) for name in ("offset", "freq", "maxerror", "esterror")),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_char * 256),
    )


def kernel_synchronised() -> bool | None:
    """Whether the clock is synchronised; None where the call is not permitted (seccomp, a strict container)."""
    if not _permitted():
        return None
    timex = _Timex()
    state = _libc().adjtimex(ctypes.byref(timex))
    if state < 0:
        return None
    return state != _TIME_ERROR and not timex.status & _STA_UNSYNC


@lru_cache(maxsize=1)
def _permitted() -> bool:
    """Whether a filter of system calls would end this process for asking: a child process tries first.

    The strict unit of an older acqd (ProtectClock=yes) has such a filter.
    """
    if "Seccomp:\t2" not in Path("/proc/self/status").read_text(encoding="ascii"):
        return True
    ask = "import ctypes; ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(512))"
    return subprocess.run([sys.executable, "-I", "-S", "-c", ask], check=False).returncode == 0


class KernelClock:
    """Asks the kernel about once a second."""

    def __init__(
        self, ask: Callable[[], bool | None] = kernel_synchronised, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._ask, self._clock = ask, clock
        self._asked = -_LOOK_S
        self.synchronised: bool | None = None
        """At the last look; None: nobody can tell."""

    def flags(self) -> frozenset[str]:
        """Flags for rows that are made now."""
        now = self._clock()
        if now - self._asked >= _LOOK_S:
            self._asked, self.synchronised = now, self._ask()
        return frozenset({UNSYNCHRONISED}) if self.synchronised is False else frozenset()


class WallClockSteps:
    """Notices that the wall clock has been set, for rows whose time is read from it directly."""

    def __init__(self) -> None:
        self._offset_ns: int | None = None

    def stepped(self, utc_ns: int, monotonic_ns: int) -> bool:
        """Whether UTC was set since the last call; both clocks are read at the same moment."""
        before, self._offset_ns = self._offset_ns, utc_ns - monotonic_ns
        return before is not None and abs(self._offset_ns - before) > STEP_NS


@lru_cache(maxsize=1)
def _libc() -> Any:
    return ctypes.CDLL(None, use_errno=True)
