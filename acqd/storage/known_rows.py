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


def newest(connection: sa.Connection, *conditions: sa.ColumnElement[bool]) -> int | None:
    """`filetime` of the newest row with these conditions; None: there is none."""
    query = sa.select(power.c.filetime).where(*conditions).order_by(power.c.filetime.desc()).limit(1)
    found = connection.execute(query).scalar()
    return None if found is None else int(found)
