"""Faults of database and disks."""

from __future__ import annotations

import random
import shutil
import signal
from contextlib import suppress
from pathlib import Path

import sqlalchemy as sa

from tools.studies.faults.bed import Bed
from tools.studies.faults.fault import RESTART_S, pause
from tools.studies.faults.on_processes import kill


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


def database_disk_full(bed: Bed, chance: random.Random) -> None:
    """Somebody else's file takes all room for the database."""
    if bed.kind.database == "sqlite":  # its log has room for megabytes where it has been longer before
        with bed.engine.connect() as connection:
            connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    bed.disks["database"].fill()
    pause(chance, 1.0, 5.0)
    bed.disks["database"].free()


def database_moved(bed: Bed, chance: random.Random) -> None:
    """Somebody moves the file of the database away (a rotation of logs, a backup), and puts it back."""
    path = Path(str(bed.engine.url.database))
    away = path.with_name(f"{path.name}.moved")
    path.rename(away)
    pause(chance, 1.0, 5.0)
    away.rename(path)


def foreign_file(bed: Bed, chance: random.Random) -> None:
    """A file manager leaves a copy of a segment in the spool, and the daemon is started again."""
    for folder in bed.folder.rglob("spool-*"):
        for path in sorted(folder.glob("*.seg"))[:1]:
            shutil.copy(path, path.with_name(f"{path.stem} (copy).seg"))
    kill(lambda bed: bed.daemon)(bed, chance)
