"""The checks of `acqd doctor` on host, clock, broker and database; each one reports a state and gives advice."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from acqd.daemon.archive_checks import archive_checks
from acqd.daemon.broker_checks import broker_checks
from acqd.daemon.compiler_checks import compiled_c
from acqd.daemon.config import Config
from acqd.daemon.disk_check import disk_check
from acqd.daemon.finding import Finding
from acqd.daemon.privilege_checks import privilege_checks
from acqd.daemon.source_checks import source_checks
from acqd.daemon.spool_checks import spool_checks
from acqd.errors import UserError

_CPU_GOVERNOR = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
_CLOCKSOURCE = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")


def all_checks(config: Config) -> list[Finding]:
    """Every check, in reading order."""
    return [
        *_host(),
        *privilege_checks(config),
        *_clock(),
        *compiled_c(),
        *(finding for source in config.every_source for finding in source_checks(source)),
        *broker_checks(config),
        database_check(config),
        disk_check(config),
        *spool_checks(config),
        *archive_checks(config),
    ]


def _host() -> Iterator[Finding]:
    yield Finding("python", "ok", f"{platform.python_version()} on {platform.machine()}, {os.cpu_count()} CPUs")
    version = platform.version()
    if "PREEMPT_RT" in version:
        yield Finding("kernel", "ok", f"{platform.release()} PREEMPT_RT")
    else:
        yield Finding("kernel", "warn", f"{platform.release()}, no PREEMPT_RT", "under load, wake-ups are late by ms")
    if _CPU_GOVERNOR.exists():
        governor = _CPU_GOVERNOR.read_text().strip()
        good = governor == "performance"
        advice = "" if good else "cpupower frequency-set -g performance"
        yield Finding("cpu governor", "ok" if good else "warn", governor, advice)


def _clock() -> Iterator[Finding]:
    if _CLOCKSOURCE.exists():
        name = _CLOCKSOURCE.read_text().strip()
        good = name in ("tsc", "kvm-clock", "arch_sys_counter")
        yield Finding("clocksource", "ok" if good else "warn", name, "" if good else "a slow clock costs every cycle")
    synchronised = Path("/run/systemd/timesync/synchronized").exists() or shutil.which("chronyc") is not None
    advice = "" if synchronised else "enable systemd-timesyncd or chrony: rows carry this clock's UTC"
    yield Finding(
        "time synchronisation", "ok" if synchronised else "warn", "on" if synchronised else "not seen", advice
    )


def database_check(config: Config) -> Finding:
    """Whether the database can be used."""
    from acqd.storage.inspect import inspect_database  # SQLAlchemy is slow to import: only when needed

    database = config.sink.database
    if "://" not in database and "@" not in database and not Path(database).exists():
        folder = Path(database).absolute().parent
        if os.access(folder, os.W_OK):
            return Finding("database", "ok", f"{database} will be created")
        return Finding("database", "fail", f"{folder} may not be written", "change its owner or [sink] database")
    try:
        return Finding("database", "ok", inspect_database(database))
    except (UserError, OSError) as error:
        return Finding("database", "fail", str(error), "see [sink] database in the configuration")


if sys.platform != "linux":  # pragma: no cover - one clear line instead of a failure deep inside
    raise UserError("acqd's daemon runs on Linux only (timerfd, eventfd, memfd)")
