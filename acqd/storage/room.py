"""Rows for as long as the disk of an SQLite database has room: what `keep_days` is where nobody sets it (ADR 94)."""

from __future__ import annotations

import shutil
from dataclasses import replace

import sqlalchemy as sa

from acqd.storage import known_rows
from acqd.storage.database import file_of
from acqd.storage.maintain import Retention
from acqd.storage.schema import power_row
from acqd.timestamps import unix_s

_DAY = 86_400.0
_LEFT = 10
"""A tenth of the disk is left to others, and to the rows that come until the next maintenance."""
_LEAST_DAYS = 1.0
"""A day of rows says too little about those to come, and late rows of a day still change roll-ups."""


def fitted(engine: sa.Engine, retention: Retention) -> Retention:
    """The retention, with fewer days of rows where these are to fit the disk and it has no room for more.

    No row is deleted because another program fills the disk: the database stops growing then, and keeps its size.
    Raises the errors of SQLAlchemy, and OSError where the disk does not say how full it is.
    """
    days = _days_of_room(engine) if retention.fits_disk else None
    return retention if days is None else replace(retention, power_days=min(retention.power_days, days))


def _days_of_room(engine: sa.Engine) -> float | None:
    """Days of rows for which there is room, if they come as those that are stored; None: unknown."""
    path = file_of(engine)
    if path is None:
        return None
    with engine.connect() as connection:
        oldest = connection.execute(sa.select(sa.func.min(power_row.c.filetime))).scalar()
        newest = known_rows.newest(connection)
        size, pages, unused = (
            int(connection.exec_driver_sql(f"PRAGMA {name}").scalar_one())
            for name in ("page_size", "page_count", "freelist_count")
        )
    days = (unix_s(int(newest)) - unix_s(int(oldest))) / _DAY if oldest is not None and newest is not None else 0.0
    if days < _LEAST_DAYS:
        return None
    disk = shutil.disk_usage(path.absolute().parent)
    room = pages * size + max(0.0, disk.free - disk.total / _LEFT)
    return max(_LEAST_DAYS, days * room / ((pages - unused) * size))
