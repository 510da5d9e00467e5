"""Time, power and register of a device's rows, in pieces: a week of one channel has fifteen million of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import sqlalchemy as sa

from acqd.storage import conversion, numbered_rows
from acqd.storage.schema import power
from acqd.timestamps import filetime

_AT_ONCE = 100_000
Piece = tuple[np.ndarray, np.ndarray, np.ndarray]
"""[n] int64 FILETIME, rising; [n] W; [n] kWh."""


def row_series(connection: sa.Connection, device: str, channel: str, begin: int, end: int) -> Iterator[Piece]:
    """Rows with a register between two Unix times [s], in the order of time."""
    first, last = filetime(begin * 10**9), filetime(end * 10**9)
    if connection.dialect.name == "sqlite" and not conversion.unfinished(connection):
        yield from _numbered(connection, device, channel, first, last)
        return
    c = power.c
    within = (c.device == device, c.channel == channel, c.filetime >= first, c.filetime < last, c.W.is_not(None))
    query = sa.select(c.filetime, c.P, c.W).where(*within).order_by(c.filetime, c.W)
    yield from _pieces(connection.execution_options(stream_results=True).execute(query))


def _numbered(connection: sa.Connection, device: str, channel: str, first: int, last: int) -> Iterator[Piece]:
    """In SQLite a run of the daemon after the other; where two overlap in time, all of them are sorted."""
    runs = numbered_rows.ids_between(connection, device, channel, first, last)
    spans = sorted((*_ends(connection, low, high), low, high, code) for low, high, code in runs)
    query = (
        "SELECT filetime, P, W FROM power_row NOT INDEXED WHERE id >= ? AND id < ? AND id & 3 = ? AND filetime >= ?"
        " AND filetime < ? AND W IS NOT NULL ORDER BY id"
    )
    apart = all(one[1] < later[0] for one, later in zip(spans, spans[1:], strict=False))
    found: list[Piece] = []
    for *_, low, high, code in spans:
        for piece in _pieces(connection.exec_driver_sql(query, (low, high, code, first, last))):
            if apart:
                yield piece
            else:
                found.append(piece)
    if found:
        ticks, P, W = (np.concatenate(each) for each in zip(*found, strict=True))
        order = np.lexsort((W, ticks))
        yield ticks[order], P[order], W[order]


def _ends(connection: sa.Connection, low: int, high: int) -> tuple[int, int]:
    """FILETIME of the first and of the last row."""
    query = "SELECT filetime FROM power_row WHERE id >= ? AND id < ? ORDER BY id {} LIMIT 1"
    first, last = (connection.exec_driver_sql(query.format(way), (low, high)).scalar() for way in ("ASC", "DESC"))
    return int(first or 0), int(last or 0)


def _pieces(result: sa.CursorResult[Any]) -> Iterator[Piece]:
    for rows in result.partitions(_AT_ONCE):
        columns = list(zip(*rows, strict=True))
        power_W = np.array([np.nan if value is None else value for value in columns[1]], dtype=np.float64)
        yield np.array(columns[0], dtype=np.int64), power_W, np.array(columns[2], dtype=np.float64)
