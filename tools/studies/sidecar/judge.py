"""What a sidecar has done, read from its database."""

from __future__ import annotations

import json
from dataclasses import dataclass

import sqlalchemy as sa


@dataclass(frozen=True, slots=True)
class DoneLog:
    """One row of the table of logs."""

    name: str
    status: str
    complete: bool
    """Whether the prediction has exactly the rows that the message says (none for a refused log)."""
    published: bool


def done_logs(engine: sa.Engine) -> list[DoneLog]:
    """Every log that was done or refused."""
    with engine.connect() as connection:
        logs = connection.exec_driver_sql("SELECT sha256, name, status, message, published FROM prediction_log").all()
        query = "SELECT sha256, count(*) FROM prediction GROUP BY sha256"
        rows: dict[str, int] = {row[0]: row[1] for row in connection.exec_driver_sql(query)}
    return [
        DoneLog(name, status, rows.get(sha256, 0) == _expected(status, text), bool(published))
        for sha256, name, status, text, published in logs
    ]


def _expected(status: str, text: object) -> int:
    message = text if isinstance(text, dict) else json.loads(str(text))
    return int(message["rows"]) if status == "ok" else 0
