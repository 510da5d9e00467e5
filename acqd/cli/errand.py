"""A command of acqd that the page runs: `python -m acqd.cli.errand ARGUMENTS`, of low priority, gone with the page."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from acqd.plc.realtime import die_with_parent

_NICE = 15
_OOM_SCORE_ADJ = "500"
"""Where memory ends, the kernel ends this process and not the page: both share the limit of one service."""


def give_way() -> None:
    """End with the parent, and leave the processor and the memory to others first, as far as this host permits it."""
    die_with_parent()
    with contextlib.suppress(OSError):  # a filter of system calls may refuse it
        os.setpriority(os.PRIO_PROCESS, 0, _NICE)
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(_OOM_SCORE_ADJ, encoding="ascii")


if __name__ == "__main__":
    give_way()
    from acqd.cli.main import main  # takes long on a busy computer: not before the priority is low

    main()
