"""Faults of the computers and of who administers them: suspended, moved, renamed, reconfigured, read-only."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import sqlalchemy as sa

from acqd.storage.database import engine_for
from tools.studies.faults.bed import DEVICE, Bed
from tools.studies.faults.fault import Begin, Fault, lasting, pause
from tools.studies.faults.on_postgres import DISCONNECT, as_administrator
from tools.studies.faults.servers import ROLE, administrator

SMALL_PACKETS, SMALL_MESSAGES = "max_packet_size 200", "message_size_limit 150"
"""Settings of mosquitto by which no row passes."""
_JUMP_S = 300.0
_TRIES = 50


def suspended(bed: Bed, chance: random.Random) -> None:
    """The computer sleeps: no process runs, and the clock has gone on when all do."""
    pids = [pid for _, process in bed.services() for pid in process.family()]
    for pid in pids:
        _signal(pid, signal.SIGSTOP)
    pause(chance, 5.0, 15.0)
    for clock in (bed.clock, bed.sink_clock):
        if clock is not None:
            clock.set(_JUMP_S)
    for pid in reversed(pids):
        _signal(pid, signal.SIGCONT)


def database_renamed(bed: Bed, fault: ExitStack) -> None:
    """Somebody gives the database another name for a while."""
    _rename_database(bed, "postgres", "other")
    fault.callback(_rename_database, bed, "other", "postgres")


def schema_renamed(bed: Bed, fault: ExitStack) -> None:
    """Somebody gives the schema of the tables another name for a while."""
    as_administrator(bed, "ALTER SCHEMA public RENAME TO moved")
    fault.callback(as_administrator, bed, "ALTER SCHEMA moved RENAME TO public")


def password_wanted(bed: Bed, fault: ExitStack) -> None:
    """The server wants a password of the role, and the sink has another one, or none."""
    rules = bed.folder / "database" / "data" / "pg_hba.conf"
    before = rules.read_text()
    fault.callback(as_administrator, bed, "SELECT pg_reload_conf()")
    fault.callback(rules.write_text, before)
    rules.write_text(f"host all {ROLE} 127.0.0.1/32 scram-sha-256\n{before}")
    as_administrator(bed, f"ALTER ROLE {ROLE} PASSWORD 'changed'", "SELECT pg_reload_conf()")
    time.sleep(0.3)  # the server reads its rules in another process
    as_administrator(bed, DISCONNECT)


def read_only(disk: str) -> Begin:
    """ext4 has met an error and takes no writes (errors=remount-ro). Only a check of the disk takes that back."""

    def begin(bed: Bed, _fault: ExitStack) -> None:
        folder = str(bed.folder / disk)
        found = subprocess.run(["findmnt", "-no", "SOURCE", folder], capture_output=True, text=True, check=True)
        subprocess.run(["mount", "-o", "remount,errors=remount-ro", folder], check=True)
        Path(f"/sys/fs/ext4/{Path(found.stdout.strip()).name}/trigger_fs_error").write_text("x")

    return begin


def spool_behind_a_link(bed: Bed, _chance: random.Random) -> None:
    """Somebody moves the spool's folder while rows wait, and leaves a symbolic link in its place."""
    bed.proxies["daemon"].mode = "silent"
    time.sleep(1.0)
    folder = next((bed.folder / "state").glob(f"spool-{DEVICE}*"))
    if not folder.is_symlink():
        moved = folder.with_name(f"moved-{folder.name}")
        folder.rename(moved)
        folder.symlink_to(moved)
    bed.proxies["daemon"].mode = "pass"


def state_moved(bed: Bed, chance: random.Random) -> None:
    """Rows wait, the daemon is stopped, and its files go to another disk, and later back: the instance is the same."""
    here, there = bed.folder / "state", bed.folder / "other-disk"
    config = bed.folder / "daemon.toml"
    proxy = bed.proxies["daemon"]
    for old, new in ((here, there), (there, here)):
        proxy.mode = "refuse"
        proxy.reset()
        pause(chance, 1.0, 3.0)
        bed.daemon.stop()
        new.mkdir(exist_ok=True)
        for path in old.iterdir():
            if path.name != "lost+found":
                subprocess.run(["cp", "-r", str(path), str(new)], check=True)  # times and owners are not kept
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        config.write_text(config.read_text().replace(f'state_dir = "{old}"', f'state_dir = "{new}"'))
        bed.daemon.start()
        pause(chance, 1.0, 2.0)
        proxy.mode = "pass"
        pause(chance, 1.0, 2.0)


def broker_set_to(line: str) -> Begin:
    """Somebody adds a line to the configuration of mosquitto, and starts it again."""

    def begin(bed: Bed, fault: ExitStack) -> None:
        config = bed.folder / "mosquitto.conf"
        before = config.read_text()

        def restart(text: str) -> None:
            bed.broker.stop()
            config.write_text(text)
            bed.broker.start()

        fault.callback(restart, before)
        restart(f"{before}\n{line}\n")

    return begin


def _rename_database(bed: Bed, old: str, new: str) -> None:
    bed.engine.dispose()
    engine = engine_for(administrator(bed.url).replace("/postgres", "/template1"))
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        for last in range(_TRIES, -1, -1):  # somebody may connect in between
            connection.exec_driver_sql(
                f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '{old}'"
            )
            try:
                connection.exec_driver_sql(f"ALTER DATABASE {old} RENAME TO {new}")
                break
            except sa.exc.DBAPIError:
                if not last:
                    raise
                time.sleep(0.1)
    engine.dispose()


def _signal(pid: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)


FAULTS: dict[str, Fault] = {
    "computer suspended": suspended,
    "spool behind a link": spool_behind_a_link,
    "state moved": state_moved,
    "broker set to small packets": lasting(broker_set_to(SMALL_PACKETS), broker_set_to(SMALL_MESSAGES)),
    "PostgreSQL: renamed": lasting(database_renamed, schema_renamed),
    "PostgreSQL: password": lasting(password_wanted),
}
