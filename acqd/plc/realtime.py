"""Real-time settings of the calling thread, as far as this host permits them."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
from dataclasses import dataclass

from acqd.memory import release_freed

_PR_SET_PDEATHSIG = 1
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_LOCK = _MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT  # what is used stays; what is never touched costs nothing


@dataclass(frozen=True, slots=True)
class RealtimeSettings:
    """What to ask for."""

    priority: int = 80
    """SCHED_FIFO priority, 0: leave the normal scheduler."""
    lock_memory: bool = True
    cpu: int | None = None
    """CPU to stay on; None: any."""


def engage(settings: RealtimeSettings) -> list[str]:
    """Apply `settings`; one sentence for each that was refused, with what to do about it.

    Call it last, in the thread that needs it.
    """
    refused = []
    gc.collect()
    gc.freeze()
    gc.disable()
    release_freed()  # what reading a recording has left
    if settings.cpu is not None:
        try:
            os.sched_setaffinity(0, {settings.cpu})
        except OSError:
            refused.append(f"CPU {settings.cpu} is not available to this process: running on any CPU")
    if settings.lock_memory and ctypes.CDLL(None, use_errno=True).mlockall(_LOCK):
        refused.append("memory not locked (raise LimitMEMLOCK / ulimit -l): a page fault can delay a cycle")
    return refused + prioritise("MAIN_FAST", settings.priority)


def prioritise(task: str, priority: int) -> list[str]:
    """Give the calling thread SCHED_FIFO with `priority` (0: leave it); a sentence if that is refused.

    Threads and processes that it starts later have the normal scheduler.
    """
    if not priority:
        return []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except PermissionError:
        advice = "raise LimitRTPRIO / ulimit -r or give CAP_SYS_NICE"
        return [f"SCHED_FIFO not permitted ({advice}): {task} has normal priority"]
    return []


def die_with_parent(parent: int | None = None) -> None:
    """Have the kernel send SIGTERM when the parent process is gone, however it went.

    `parent`: its process id, for a process that may have lost its parent before it came here: it ends at once.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if parent is not None and os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGTERM)
