"""Predicted against measured power of the logs that the sidecar has worked through."""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa

from acqd.storage.schema import prediction, prediction_log
from acqd.timestamps import unix_s

_LOGS = 12
_MOST_POINTS = 1200
_SHOWN = ("begin", "end", "rmse_W", "mae_W", "energy_kWh", "energy_predicted_kWh", "covered", "drift", "reason")


def logs(engine: sa.Engine) -> list[dict[str, Any]]:
    """The newest logs: hash, name, model, status, the figures of their messages, and the alarm that they raised."""
    table = prediction_log.c
    query = sa.select(table.sha256, table.name, table.model, table.status, table.message).where(
        table.status != "superseded"
    )
    with engine.connect() as connection:
        rows = connection.execute(query.order_by(table.done.desc()).limit(_LOGS)).all()
    return [_log(*row) for row in rows]


def alarms(engine: sa.Engine) -> list[dict[str, Any]]:
    """Alarms that are stored with their logs, newest first: `onset_s`, `raised_s` (Unix s), chart, log."""
    query = sa.select(prediction_log.c.message).order_by(prediction_log.c.done.desc())
    with engine.connect() as connection:
        messages = connection.execute(query).scalars()
        found = [message["alarm"] for message in messages if message.get("alarm")]
    return sorted(found, key=lambda alarm: -alarm["raised_s"])


def logs_since(engine: sa.Engine, onset: str) -> list[str]:
    """Names of the logs that end after `onset` (RFC 3339) and could be compared, oldest first."""
    query = sa.select(prediction_log.c.name, prediction_log.c.message).where(prediction_log.c.status == "ok")
    with engine.connect() as connection:
        rows = connection.execute(query).all()
    return [name for _, name in sorted((m["begin"], name) for name, m in rows if m["end"] > onset)]


def course(engine: sa.Engine, sha256: str) -> dict[str, Any]:
    """Times [Unix s], measured and predicted power and residual [W] of a log, thinned by means of equal numbers."""
    query = sa.select(prediction.c.filetime, prediction.c.P, prediction.c.P_predicted).where(
        prediction.c.sha256 == sha256
    )
    with engine.connect() as connection:
        rows = connection.execute(query.order_by(prediction.c.filetime)).all()
    size = -(-len(rows) // _MOST_POINTS) or 1
    groups = [rows[k : k + size] for k in range(0, len(rows), size)]
    measured = [_mean([row[1] for row in group]) for group in groups]
    predicted = [_mean([row[2] for row in group]) for group in groups]
    return {
        "time": [unix_s(group[0][0]) for group in groups],
        "measured": measured,
        "predicted": predicted,
        "residual": [m - p for m, p in zip(measured, predicted, strict=True)],
        "rows_per_point": size,
    }


def _log(sha256: str, name: str, model: str, status: str, message: dict[str, Any]) -> dict[str, Any]:
    figures = {key: message[key] for key in _SHOWN if key in message}
    return {"sha256": sha256, "name": name, "model": model, "status": status, "alarm": message.get("alarm")} | figures


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)
