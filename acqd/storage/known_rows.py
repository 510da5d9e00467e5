"""Which devices have rows, and which row is the newest: by a seek in an index, in both layouts."""

from __future__ import annotations

import sqlalchemy as sa

from acqd.storage.schema import power


def devices(connection: sa.Connection) -> list[str]:
    """Names of all devices with rows, in order."""
    sqlite = connection.dialect.name == "sqlite"
    names: list[str] = []
    table = sa.table("power_run", sa.column("device")) if sqlite else power
    query = sa.select(sa.func.min(table.c.device))
    while name := connection.execute(query.where(table.c.device > names[-1]) if names else query).scalar():
        names.append(str(name))
    return [name for name in names if not sqlite or _has_rows(connection, name)]


def _has_rows(connection: sa.Connection, device: str) -> bool:
    return connection.execute(sa.select(sa.literal(1)).where(power.c.device == device).limit(1)).scalar() is not None


def newest(connection: sa.Connection, device: str | None = None, until: int = 2**63 - 1) -> int | None:
    """`filetime` of the newest row, of a device, not later than `until`; None: there is no such row.

    By the index on time, from the newest row on: SQLite would read all rows of the device and sort them.
    """
    c = power.c
    query = sa.select(c.filetime).where(c.filetime <= until).order_by(c.filetime.desc()).limit(1)
    if device is not None:
        name = c.device.op("||")("") if connection.dialect.name == "sqlite" else c.device
        query = query.where(name == device)
    found = connection.execute(query).scalar()
    return None if found is None else int(found)
