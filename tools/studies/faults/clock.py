"""A clock that can be set: libfaketime, with the kernel's own sleeps and timers.

libfaketime 0.9.10 moves moments of CLOCK_MONOTONIC, too: Python's `time.sleep` fails, a timer waits for days.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

CACHE_S = 1
"""How long libfaketime may take to notice that the clock was set [s]."""
_LIBRARIES = sorted(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))
_WAITS = """
#define _GNU_SOURCE
#include <errno.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *request, struct timespec *left)
{
    return syscall(SYS_clock_nanosleep, clock, flags, request, left) ? errno : 0;
}
int timerfd_settime(int timer, int flags, const struct itimerspec *wanted, struct itimerspec *before)
{
    return syscall(SYS_timerfd_settime, timer, flags, wanted, before);
}
"""


def missing() -> str:
    """Why clocks cannot be set, else empty."""
    if not _LIBRARIES:
        return "libfaketime is not installed (apt-get install libfaketime)"
    return "" if shutil.which("cc") else "a C compiler is needed"


class FakedClock:
    """The clock of processes, some seconds ahead of this computer's."""

    def __init__(self, file: Path) -> None:
        """`file`: what libfaketime reads."""
        self._file, self._waits = file, file.with_name(f"{file.name}.so")
        command = ["cc", "-shared", "-fPIC", "-x", "c", "-", "-o", str(self._waits)]
        subprocess.run(command, input=_WAITS.encode(), check=True)
        self.set(0.0)

    def environment(self) -> dict[str, str]:
        """Of the processes."""
        return {
            "LD_PRELOAD": f"{self._waits}:{_LIBRARIES[-1]}", "FAKETIME_TIMESTAMP_FILE": str(self._file),
            "FAKETIME_DONT_FAKE_MONOTONIC": "1", "DONT_FAKE_MONOTONIC": "1", "FAKETIME_CACHE_DURATION": str(CACHE_S),
        }  # fmt: skip

    def set(self, seconds: float) -> None:
        """Put the clock so many seconds ahead."""
        new = self._file.with_suffix(".new")
        new.write_text(f"{seconds:+}")
        os.replace(new, self._file)
