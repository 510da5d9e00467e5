"""Faults of database and disks."""

from __future__ import annotations

import errno
import random
import shutil
import signal
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import sqlalchemy as sa

from tools.studies.faults.bed import DEVICE, Bed
from tools.studies.faults.fault import RESTART_S, Fault, pause
from tools.studies.faults.messages import publish
from tools.studies.faults.on_processes import kill

_WAITS_S = 30.0
_ERRORS = (errno.EIO, errno.ESTALE, errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.EMFILE)
_REFUSED = (
    ("write",), ("write", "unlink"), ("sync",), ("rename",), ("open",), ("close",), ("stat",), ("read",),
    ("open", "read", "write", "sync", "rename", "unlink", "stat", "truncate"),
)  # fmt: skip
"""Calls that fail together."""


def lock(bed: Bed, chance: random.Random) -> None:
    """Somebody else's transaction holds the table."""
    with bed.engine.connect() as connection:
        if bed.kind.database == "sqlite":
            connection.exec_driver_sql("BEGIN EXCLUSIVE")
        else:
            connection.execute(sa.text("LOCK TABLE power IN ACCESS EXCLUSIVE MODE"))
        pause(chance, 0.5, 5.0)
        connection.rollback()
        if bed.kind.database == "sqlite":
            with suppress(sa.exc.SQLAlchemyError):
                connection.exec_driver_sql("ROLLBACK")


def database_crash(bed: Bed, chance: random.Random) -> None:
    """SIGQUIT: PostgreSQL ends at once and recovers from its log (immediate shutdown)."""
    assert bed.database is not None
    bed.database.stop(signal.SIGQUIT)
    pause(chance, *RESTART_S)
    bed.database.start()


def spool_disk_full(bed: Bed, chance: random.Random) -> None:
    """Somebody else's file takes all room for the spool; sometimes the broker is away meanwhile, too."""
    proxy = bed.proxies["daemon"]
    bed.disks["spool"].fill()
    proxy.mode = chance.choice(["pass", "silent"])
    pause(chance, 1.0, 5.0)
    bed.disks["spool"].free()
    proxy.mode = "pass"


def stopped_on_a_full_disk(bed: Bed, chance: random.Random) -> None:
    """The disk of the spool is full and the broker away; the daemon is stopped, the disk freed, the daemon started."""
    proxy = bed.proxies["daemon"]
    bed.disks["spool"].fill()
    proxy.mode = "refuse"
    proxy.reset()
    pause(chance, 1.0, 4.0)
    bed.daemon.stop()
    bed.disks["spool"].free()
    bed.daemon.start()
    pause(chance, 0.5, 1.0)
    proxy.mode = "pass"


def spool_deleted_then_disk_full(bed: Bed, chance: random.Random) -> None:
    """Somebody deletes the spool's folder, and with it what a stop on a full disk needs; then comes such a stop."""
    spool_deleted(bed, chance)
    stopped_on_a_full_disk(bed, chance)


def spool_unreadable(bed: Bed, chance: random.Random) -> None:
    """Opening the segments that wait answers an error for 6 s after a start; the files are whole."""
    proxy = bed.proxies["daemon"]
    proxy.mode = "refuse"
    proxy.reset()
    pause(chance, 2.0, 4.0)
    bed.daemon.stop()
    segments = list(_segments(bed))
    for path in segments:
        path.rename(path.with_suffix(".whole"))
        path.symlink_to(path.name)  # a loop: ELOOP, whoever asks
    bed.daemon.start()
    proxy.mode = "pass"
    time.sleep(6.0)
    for path in segments:
        path.with_suffix(".whole").replace(path)


def wait_for_one_segment(bed: Bed) -> bool:
    """Whether, within some time, no rows wait in closed files."""
    deadline = time.monotonic() + _WAITS_S
    while len(list(_segments(bed))) > 1:
        if time.monotonic() > deadline:
            return False
        time.sleep(0.2)
    return True


def spool_deleted(bed: Bed, chance: random.Random) -> None:
    """Somebody deletes the spool's folder while no closed file waits; a moment later the broker is away.

    Rows in closed files that a person deletes are gone. A folder behind a link (another fault) is left alone.
    """
    proxy = bed.proxies["daemon"]
    if not wait_for_one_segment(bed):
        return
    for folder in {path.parent.resolve() for path in _segments(bed) if not path.parent.is_symlink()}:
        while folder.exists():  # the daemon may make a file meanwhile
            shutil.rmtree(folder, ignore_errors=True)
    proxy.mode = "silent"
    pause(chance, 1.0, 4.0)
    proxy.mode = "pass"


def database_disk_full(bed: Bed, chance: random.Random) -> None:
    """Somebody else's file takes all room for the database."""
    if bed.kind.database == "sqlite":  # its log has room for megabytes where it has been longer before
        with bed.engine.connect() as connection:
            connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    bed.disks["database"].fill()
    pause(chance, 1.0, 5.0)
    bed.disks["database"].free()


def database_moved(bed: Bed, chance: random.Random) -> None:
    """Somebody moves the file of the database away (a rotation of logs, a backup), and puts it back.

    A sidecar that starts meanwhile would end, for it takes the path for a mistake.
    """
    _wait_for_sidecar(bed)
    path = Path(str(bed.engine.url.database))
    away = path.with_name(f"{path.name}.moved")
    path.rename(away)
    pause(chance, 1.0, 5.0)
    away.rename(path)


def database_put_back(bed: Bed, chance: random.Random) -> None:
    """Somebody puts a backup of the file back that is some seconds old: the daemon sends again what it lacks.

    A sidecar looks which logs are done when it starts, so it is started again.
    """
    _put_back(bed, chance, stopped=False)


def database_put_back_at_rest(bed: Bed, chance: random.Random) -> None:
    """The same while the sink is stopped: it has to see at its start that rows with a receipt are missing."""
    _put_back(bed, chance, stopped=True)


def database_put_back_unseen(bed: Bed, chance: random.Random) -> None:
    """The same while the daemon has no connection: the sink asks for rows, and the daemon cannot hear that."""
    proxy = bed.proxies["daemon"]
    time.sleep(1.0)  # rows whose receipt is on its way
    proxy.mode = "refuse"
    proxy.reset()
    _put_back(bed, chance, stopped=False)
    publish(bed.port, [(f"acqd/{DEVICE}/L1/power", b"{")])  # somebody else's message makes the sink look
    pause(chance, 1.0, 3.0)
    if chance.random() < 0.5:  # its next start has to know what the daemon has not heard
        bed.sink.stop()
        bed.sink.start()
    proxy.mode = "pass"


def _wait_for_sidecar(bed: Bed) -> None:
    """Until it holds its lock beside the database: a start takes a while on a busy computer."""
    deadline = time.monotonic() + _WAITS_S
    while bed.sidecar is not None and time.monotonic() < deadline:
        for pid in bed.sidecar.family():
            with suppress(OSError):
                if any(file.readlink().name.endswith(".sidecar-lock") for file in Path(f"/proc/{pid}/fd").iterdir()):
                    return
        time.sleep(0.1)


def _put_back(bed: Bed, chance: random.Random, *, stopped: bool) -> None:
    path = Path(str(bed.engine.url.database))
    backup = path.with_name(f"{path.name}.backup")
    with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(backup)) as target:
        source.backup(target)
    pause(chance, 1.0, 4.0)
    if stopped:
        bed.sink.stop()
    backup.replace(path)
    for name in ("-wal", "-shm"):
        path.with_name(path.name + name).unlink(missing_ok=True)
    if stopped:
        bed.sink.start()
    bed.engine.dispose()
    if bed.sidecar is not None:
        bed.sidecar.stop()
        bed.sidecar.start()


def table_refuses(bed: Bed, chance: random.Random) -> None:
    """Somebody adds a rule to the table that one channel breaks, and takes it back: the other channels are stored."""
    if bed.kind.database == "sqlite":
        begin = "CREATE TRIGGER no BEFORE INSERT ON power_row WHEN NEW.id & 3 = 1 BEGIN SELECT RAISE(ABORT, 'no'); END"
        end = "DROP TRIGGER no"
    else:
        begin = "ALTER TABLE power ADD CONSTRAINT no CHECK (channel <> 'L2') NOT VALID"
        end = "ALTER TABLE power DROP CONSTRAINT no"
    with bed.engine.begin() as connection:
        connection.exec_driver_sql(begin)
    pause(chance, 1.0, 6.0)
    with bed.engine.begin() as connection:
        connection.exec_driver_sql(end)


def foreign_file(bed: Bed, chance: random.Random) -> None:
    """A file manager leaves a copy of a segment in the spool, and the daemon is started again."""
    for path in list(_segments(bed))[:1]:
        shutil.copy(path, path.with_name(f"{path.stem} (copy).seg"))
    kill(lambda bed: bed.daemon)(bed, chance)


def disk_errors(side: str) -> Fault:
    """The disk of a service answers errors for some seconds, as a share that is away or a card that has become old."""

    def fault(bed: Bed, chance: random.Random) -> None:
        refusals = bed.refusals[side]
        refusals.answer(chance.choice(_ERRORS), *chance.choice(_REFUSED))
        pause(chance, 1.0, 5.0)
        refusals.answer(0)

    return fault


def _segments(bed: Bed) -> Iterator[Path]:
    """Of the daemon's spool, oldest first; without the copies of `foreign_file`."""
    return (path for path in sorted(bed.folder.rglob("spool-*/*.seg")) if path.stem.isdigit())
