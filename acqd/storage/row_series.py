"""Time, power and register of a device's rows, in pieces: a week of one channel has fifteen million of them."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from itertools import pairwise
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
    result = connection.execution_options(stream_results=True).execute(query)
    yield from (_piece([tuple(row) for row in rows], 0) for rows in result.partitions(_AT_ONCE))


def _numbered(connection: sa.Connection, device: str, channel: str, first: int, last: int) -> Iterator[Piece]:
    """In SQLite a run of the daemon after the other; where two overlap in time, all of them are sorted."""
    runs = numbered_rows.ids_between(connection, device, channel, first, last)
    spans = sorted((*_ends(connection, low, high), low, high, code) for low, high, code in runs)
    query = (
        f"SELECT filetime - {first}, P, W FROM power_row NOT INDEXED WHERE id >= ? AND id < ? AND id & 3 = ?"
        " AND filetime >= ? AND filetime < ? AND W IS NOT NULL ORDER BY id"
    )
    apart = all(one[1] < later[0] for one, later in pairwise(spans))
    found: list[Piece] = []
    for *_, low, high, code in spans:
        for piece in _fetched(connection, query, (low, high, code, first, last), first):
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


def _fetched(connection: sa.Connection, query: str, parameters: tuple[int, ...], first: int) -> Iterator[Piece]:
    """By the driver itself: the rows of SQLAlchemy take three times as long."""
    cursor = connection.connection.cursor()
    try:
        cursor.execute(query, parameters)
        while rows := cursor.fetchmany(_AT_ONCE):
            yield _piece(rows, first)
    except sqlite3.Error as error:
        raise sa.exc.OperationalError(query, parameters, error) from error
    finally:
        cursor.close()


def _piece(rows: Sequence[tuple[Any, ...]], first: int) -> Piece:
    """Rows of FILETIME since `first`, W and kWh; None becomes NaN."""
    values = np.array([row[1:] for row in rows], dtype=np.float64)
    return np.array([row[0] for row in rows], dtype=np.int64) + first, values[:, 0], values[:, 1]
