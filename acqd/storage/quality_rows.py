"""Rows of power quality into the table `power_quality`; a row whose key is stored has come before."""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.schema import power_quality
from acqd.telemetry.quality_row import QualityRow


def insert(connection: sa.Connection, rows: list[QualityRow]) -> None:
    """Insert what is new. Raises the errors of SQLAlchemy."""
    if not rows:
        return
    postgres = connection.dialect.name == "postgresql"
    statement: Any = (postgresql.insert if postgres else sqlite.insert)(power_quality)
    values = [asdict(row) for row in rows]
    if postgres:
        for value in values:
            value["time"] = datetime.fromisoformat(value["time"])
    connection.execute(statement.on_conflict_do_nothing(), values)
