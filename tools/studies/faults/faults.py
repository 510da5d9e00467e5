"""All faults by name, and what each needs."""

from __future__ import annotations

import signal

from tools.studies.faults import by_strangers, on_hosts, on_paths, on_postgres
from tools.studies.faults.bed import Extras, Kind
from tools.studies.faults.fault import Fault, Pick
from tools.studies.faults.on_clocks import days_ahead, days_behind, maintained, sink_behind, stepped
from tools.studies.faults.on_network import cut, latency, reset
from tools.studies.faults.on_processes import (
    all_killed,
    fast,
    fast_stalls,
    freeze,
    kill,
    restart,
    second_daemon,
    stalls,
)  # fmt: skip
from tools.studies.faults.on_storage import (
    database_crash,
    database_disk_full,
    database_moved,
    database_put_back,
    database_put_back_at_rest,
    database_put_back_unseen,
    disk_errors,
    foreign_file,
    lock,
    spool_deleted,
    spool_deleted_then_disk_full,
    spool_disk_full,
    spool_unreadable,
    stopped_on_a_full_disk,
    table_refuses,
)

_PROCESSES: dict[str, Pick] = {
    "daemon": lambda bed: bed.daemon,
    "sink": lambda bed: bed.sink,
    "broker": lambda bed: bed.broker,
    "sidecar": lambda bed: bed.sidecar,
}
ALL: dict[str, Fault] = (
    {
        "MAIN_FAST killed": fast(signal.SIGKILL),
        "MAIN_FAST killed thrice": fast(signal.SIGKILL, 3),
        "MAIN_FAST hung": fast(signal.SIGSTOP),
        "MAIN_FAST stalled": fast_stalls,
        "database locked": lock,
        "database crashed": database_crash,
        "database disk full": database_disk_full,
        "database moved away": database_moved,
        "foreign file in the spool": foreign_file,
        "spool disk full": spool_disk_full,
        "all killed": all_killed,
        "second daemon": second_daemon,
        "clock set": stepped,
        "clock days ahead": days_ahead,
        "clock days behind": days_behind,
        "sink's clock behind": sink_behind,
        "maintenance with a wrong clock": maintained,
        "database put back": database_put_back,
        "database put back at rest": database_put_back_at_rest,
        "database put back unseen": database_put_back_unseen,
        "table refuses rows": table_refuses,
        "spool unreadable": spool_unreadable,
        "spool deleted": spool_deleted,
        "stopped on a full disk": stopped_on_a_full_disk,
        "spool deleted, then disk full": spool_deleted_then_disk_full,
        "daemon's disk answers errors": disk_errors("daemon"),
        "sink's disk answers errors": disk_errors("sink"),
    }
    | by_strangers.FAULTS
    | on_hosts.FAULTS
    | on_paths.FAULTS
    | on_postgres.FAULTS
)
for _name, _pick in _PROCESSES.items():
    ALL[f"{_name} killed"] = kill(_pick)
    ALL[f"{_name} restarted"] = restart(_pick)
    ALL[f"{_name} frozen"] = freeze(_pick)
    ALL[f"{_name} stalled"] = stalls(_pick)
for _side in ("daemon", "sink"):
    ALL[f"{_side}: half-open"] = cut(_side, "silent", also_reset=False)
    ALL[f"{_side}: no route"] = cut(_side, "refuse", also_reset=True)
    ALL[f"{_side}: resets"] = reset(_side)
    ALL[f"{_side}: latency"] = latency(_side)
_NEEDS = {
    "clock": (
        "clock set", "clock days ahead", "clock days behind", "sink's clock behind", "maintenance with a wrong clock",
    ),
    "disks": (
        "database disk full", "spool disk full", "stopped on a full disk", "spool deleted, then disk full",
        "PostgreSQL: disk of its log full", "mounted over the spool", "mounted over the database",
    ),
    "pooler": ("PostgreSQL: pooler",),
    "refusals": ("daemon's disk answers errors", "sink's disk answers errors"),
}  # fmt: skip

_FILES = {
    "sink's disk answers errors", "database moved away", "database put back", "database put back at rest",
    "database put back unseen", "mounted over the database", "sink's files limited", "sink's computer put back",
    "database's log cut off",
}  # fmt: skip
"""Faults of a database that is a file."""


def possible(kind: Kind, extras: Extras) -> list[str]:
    """The faults that a bed can have."""
    without = {name for need, names in _NEEDS.items() if not getattr(extras, need) for name in names}
    if kind.database != "postgres":
        without |= {"database crashed", *(name for name in ALL if name.startswith("PostgreSQL"))}
    without |= set() if kind.broker.startswith("mosquitto") else {"broker set to small packets"}
    without |= set() if kind.database == "sqlite" else _FILES
    without |= set() if extras.sidecar else {name for name in ALL if name.startswith("sidecar")}
    return [name for name in ALL if name not in without]
