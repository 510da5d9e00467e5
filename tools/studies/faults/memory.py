"""Memory limits of processes, as the units set them with MemoryMax."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

_SYSTEMD = Path(__file__).parents[3] / "systemd"
_CGROUPS = Path("/sys/fs/cgroup")
_FACTORS = {"M": 1 << 20, "G": 1 << 30}


def unit_limit(service: str) -> int:
    """MemoryMax [bytes] of a unit of systemd/, by its name without `.service`."""
    found = re.search(r"^MemoryMax=(\d+)([MG])$", (_SYSTEMD / f"{service}.service").read_text(), re.MULTILINE)
    assert found is not None, f"{service}.service has no MemoryMax"
    return int(found[1]) * _FACTORS[found[2]]


def limited(command: Sequence[str], limit: int) -> list[str]:
    """The command under a limit [bytes], with the same process id.

    Where control groups (version 2) are delegated to this user, the limit is memory.max of a group, as with systemd.
    Elsewhere prlimit sets RLIMIT_DATA for each process: private writable memory, where an allocation beyond it fails
    instead of ending the process. Whoever uses that has to look at the resident memory, too (see `how`).
    """
    group = _delegated()
    if group is None:
        return ["prlimit", f"--data={limit}", *command]
    script = 'mkdir -p "$0" && echo "$1" > "$0/memory.max" && echo $$ > "$0/cgroup.procs" && shift && exec "$@"'
    return ["sh", "-c", script, str(group / f"acqd-faults-{limit}"), str(limit), *command]


def how() -> str:
    """What sets the limit on this computer."""
    return "RLIMIT_DATA (no control group is delegated)" if _delegated() is None else "memory.max of a control group"


def _delegated() -> Path | None:
    """The control group of this process, if it may have children with a memory limit."""
    line = Path("/proc/self/cgroup").read_text().strip()
    group = _CGROUPS / line.removeprefix("0::/")
    control = group / "cgroup.subtree_control"
    usable = line.startswith("0::") and control.exists() and os.access(control, os.W_OK)
    return group if usable and "memory" in control.read_text().split() else None
