"""The checks of `acqd doctor` on what the kernel grants: real-time priority, locked memory, raw network access.

The priority is asked for as `acqd run` does. The name root says little: in a container, or in a unit with a bounding
set, root may lack the very right.
"""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from pathlib import Path

from acqd.daemon.config import Config
from acqd.daemon.finding import Finding

NET_ADMIN, NET_RAW = 12, 13
_IPC_LOCK = 14
_NAMES = {NET_ADMIN: "CAP_NET_ADMIN", NET_RAW: "CAP_NET_RAW"}


def privilege_checks(config: Config) -> Iterator[Finding]:
    """Whether MAIN_FAST gets the priority and the locked memory that the configuration asks for."""
    yield _priority(config.realtime.priority)
    yield _locked_memory(wanted=config.realtime.lock_memory)


def raw_network_access(needed: list[int]) -> Finding:
    """Whether this user has the capabilities for raw Ethernet, without which `acqd run` does not start."""
    lacking = [_NAMES[capability] for capability in needed if not _has(capability)]
    if not lacking:
        return Finding("raw network access", "ok", "permitted to this user")
    advice = f"AmbientCapabilities={' '.join(lacking)} in the service's unit: acqd service install --rights raw-network"
    return Finding("raw network access", "fail", f"{' and '.join(lacking)} missing for this user", advice)


def _priority(priority: int) -> Finding:
    if not priority:
        return Finding("real-time priority", "ok", "not asked for")
    policy, before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except PermissionError:
        advice = "LimitRTPRIO=99 / ulimit -r 99, or CAP_SYS_NICE"
        return Finding(
            "real-time priority", "warn", f"SCHED_FIFO {priority} is refused: MAIN_FAST has normal priority", advice
        )
    os.sched_setscheduler(0, policy, before)
    return Finding("real-time priority", "ok", f"SCHED_FIFO {priority} is permitted to this user")


def _locked_memory(*, wanted: bool) -> Finding:
    if not wanted:
        return Finding("locked memory", "ok", "not asked for")
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if limit == resource.RLIM_INFINITY or _has(_IPC_LOCK):
        return Finding("locked memory", "ok", "permitted to this user")
    advice = "LimitMEMLOCK=infinity / ulimit -l unlimited, or CAP_IPC_LOCK"
    return Finding("locked memory", "warn", f"limit {limit} bytes: a page fault can delay a cycle", advice)


def _has(capability: int) -> bool:
    """Whether this process holds a capability."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    held = next(line for line in status.splitlines() if line.startswith("CapEff")).split()[1]
    return bool(int(held, 16) >> capability & 1)
