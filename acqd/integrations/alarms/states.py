"""What the status of a daemon says is wrong, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import orjson

from acqd.telemetry import topics


def wrong(payload: bytes) -> dict[str, str] | None:
    """Kind and sentence of everything that is wrong; None for a payload that is no status."""
    if payload == topics.OFFLINE:
        return {"offline": "the daemon is offline: no rows are metered"}
    try:
        status: Any = orjson.loads(payload)
    except orjson.JSONDecodeError:
        return None
    return dict(_faults(status)) if isinstance(status, dict) else None


def _faults(status: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield from _source(status, "source", "the source")
    for name, meter in _table(status, "meters"):
        if meter.get("trouble"):
            yield f"meter-{name}", f"meter {name} is silent: {meter['trouble']}"
    for name, box in _table(status, "boxes"):
        if box.get("trouble"):
            yield f"box-{name}", f"box {name}: {box['trouble']}"
        yield from _source(box, f"source-{name}", f"the source of box {name}")
    spool = status.get("spool")
    if isinstance(spool, dict):
        if spool.get("disk_trouble"):
            yield "disk", f"the spool cannot write to its disk: {spool['disk_trouble']}"
        limit, size = spool.get("spool_limit_bytes") or 0, spool.get("spool_bytes") or 0
        if limit and size >= 0.9 * limit:
            yield "spool", "the spool is nearly full: rows will be lost"


def _source(status: dict[str, Any], kind: str, name: str) -> Iterator[tuple[str, str]]:
    health = status.get("source_health")
    if isinstance(health, dict) and health.get("connected") is False:
        yield kind, f"{name} is away: {health.get('reason') or 'no reason given'}"


def _table(status: dict[str, Any], key: str) -> Iterator[tuple[str, dict[str, Any]]]:
    table = status.get(key)
    for name, content in table.items() if isinstance(table, dict) else ():
        if isinstance(content, dict):
            yield str(name), content
