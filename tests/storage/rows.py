"""Rows to store, and how many of them are stored."""

from __future__ import annotations

import sqlalchemy as sa
from msgspec import structs

from acqd.storage.received import Received
from acqd.storage.schema import power
from acqd.telemetry.row import PowerRow
from acqd.timestamps import filetime, rfc3339

T0 = 1_700_000_100  # a whole quarter hour plus nothing: 1_700_000_100 % 900 == 0


def row(seq=0, channel="L1", t=T0, **changes) -> PowerRow:
    ns = int(t * 1e9)
    base = PowerRow(
        "cell1",
        channel,
        "boot1",
        seq,
        rfc3339(ns),
        filetime(ns),
        230.5,
        1.25,
        280.0,
        288.1,
        0.97,
        50.01,
        0.001 * seq,
        [],
    )
    return structs.replace(base, **changes)


def message(r: PowerRow) -> Received:
    return Received(f"acqd/{r.device}/{r.channel}/power", r.to_json())


def count(engine, table=power) -> int:
    with engine.connect() as connection:
        return connection.execute(sa.select(sa.func.count()).select_from(table)).scalar()
