"""Rows for as long as the disk of an SQLite database has room: what `keep_days` is where nobody sets it (ADR 94)."""

from __future__ import annotations

import shutil
from dataclasses import replace

import sqlalchemy as sa

from acqd.storage import state
from acqd.storage.database import file_of, transaction
from acqd.storage.maintain import Retention
from acqd.storage.schema import power_row
from acqd.timestamps import unix_s

_DAY = 86_400.0
_LEFT = 10
"""A tenth of the disk is left to others, and to the rows that come until the next maintenance."""
_LEAST_DAYS = 1.0
"""A day of rows stays: late rows of a day still change roll-ups."""


def fitted(engine: sa.Engine, retention: Retention, now: float) -> Retention:
    """The retention, with fewer days of rows where these are to fit the disk and it has no room for more.

    The oldest rows go, as many as do not fit. The database does not become smaller because another program fills the
    disk: its size is remembered from one call to the next, and it stops growing. `now` is Unix seconds. Raises the
    errors of SQLAlchemy, and OSError where the disk does not say how full it is.
    """
    path = file_of(engine)
    if path is None:
        return retention
    with transaction(engine) as connection:
        size, pages, unused = (
            int(connection.exec_driver_sql(f"PRAGMA {name}").scalar_one())
            for name in ("page_size", "page_count", "freelist_count")
        )
        used = room = (pages - unused) * size
        if retention.fits_disk:
            disk = shutil.disk_usage(path.absolute().parent)
            room = max(_size_before(connection, used), pages * size + disk.free - disk.total // _LEFT)
        state.write(connection, state.SIZE, str(min(room, used)))
        cut = _oldest_but(connection, 1.0 - room / used) if used > room else None
    if cut is None:
        return retention
    days = max(_LEAST_DAYS, (now - cut) / _DAY)
    return replace(retention, power_days=min(retention.power_days, days) if retention.power_days else days)


def _size_before(connection: sa.Connection, used: int) -> int:
    """Bytes of the database that the last call left to it; before the first call, those that it has."""
    before = state.read(connection, state.SIZE) or ""
    return int(before) if before.isdecimal() and len(before) < 19 else used


def _oldest_but(connection: sa.Connection, share: float) -> float | None:
    """Time of the oldest row if this share of the rows went [Unix s]; None: there are no rows."""
    count = int(connection.execute(sa.select(sa.func.count()).select_from(power_row)).scalar_one())
    times = sa.select(power_row.c.filetime).order_by(power_row.c.filetime)
    oldest = connection.execute(times.limit(1).offset(int(share * count))).scalar()
    return None if oldest is None else unix_s(int(oldest))
