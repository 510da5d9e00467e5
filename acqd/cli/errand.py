"""A command of acqd that the page runs: `python -m acqd.cli.errand ARGUMENTS`, of low priority, gone with the page.

MAIN_FAST has SCHED_FIFO, which any normal process gives way to, whatever its nice value. What needs protection are the
normal threads of the daemon, the sink and the page: they sleep most of the time, and must run as soon as they wake.
SCHED_BATCH does that (sched(7)): the command does not preempt them when it wakes, and they preempt it. The nice value
only divides what is left among those that compute all the time. At 15, a command had a thirtieth of the time that a
busy normal process has, and on a busy computer it did not come to its end; at 5 it has a third.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from acqd.plc.realtime import die_with_parent

_NICE = 5
_OOM_SCORE_ADJ = "500"
"""Where memory ends, the kernel ends this process and not the page: both share the limit of one service."""


def give_way() -> None:
    """End with the parent, and leave the processor and the memory to others first, as far as this host permits it."""
    die_with_parent()
    with contextlib.suppress(OSError):  # a filter of system calls may refuse it
        os.nice(_NICE)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(_OOM_SCORE_ADJ, encoding="ascii")


if __name__ == "__main__":
    give_way()
    from acqd.cli.main import main  # takes long on a busy computer: not before the priority is low

    main()
