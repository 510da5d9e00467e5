"""Rows of registers: from the windows of a meter to payload, message and table, on SQLite and on a real PostgreSQL."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import pytest
import sqlalchemy as sa

from acqd.storage.database import open_database
from acqd.storage.maintain import Retention, maintain
from acqd.storage.received import Received
from acqd.storage.schema import power_register, quarantine
from acqd.storage.writer import Writer
from acqd.telemetry.register_row import NUMBERS, OnceAMinute, RegisterRow, parse_registers, register_row
from acqd.telemetry.spool import Stream
from acqd.timestamps import rfc3339
from tests.storage.rows import T0, count, message, row

READINGS = {name: 1.5 + k for k, name in enumerate(NUMBERS)}


def summary(second=0, channel="L1", **changes):
    key = {"device": "cell1", "channel": channel, "boot": "boot1", "seq": 25 * second}
    return {**key, "time": rfc3339((T0 + second) * 10**9), "Vrms": 230.0, **READINGS, **changes}


def received(one: RegisterRow) -> Received:
    return Received(f"acqd/cell1/{one.channel}/registers", one.to_json())


def test_a_row_holds_the_registers_of_the_first_summary_of_a_minute():
    times = OnceAMinute()
    due = [k for k in range(150) if times.due(summary(k)) and times.due(summary(k, "L2"))]
    assert due == [0, 60, 120] if T0 % 60 == 0 else len(due) == 3
    one = register_row(summary(5))
    assert {name: getattr(one, name) for name in NUMBERS} == READINGS and one.seq == 125
    assert parse_registers(one.to_json()) == one
    assert {field.name for field in dataclasses.fields(RegisterRow)} == {each.name for each in power_register.columns}
    meter = {
        name: value for name, value in summary().items() if name in ("W_import", "W_export") or name not in NUMBERS
    }
    assert register_row(meter).P_demand is None, "an RMS meter has two registers"


def test_rows_are_stored_once_have_receipts_and_conflicts_go_to_quarantine(database):
    engine = open_database(database)
    writer, rows = (
        Writer(engine),
        [register_row(summary(60 * k, channel)) for k in range(3) for channel in ("L1", "L2")],
    )
    written = writer.write([message(row(0)), *map(received, rows[:4])])
    assert written.rows == 5 and list(written.receipts[Stream("cell1", "L1/registers", "boot1")]) == [
        (0, 0),
        (1500, 1500),
    ]
    assert writer.write(list(map(received, rows))).rows == 6 and count(engine, power_register) == 6
    assert writer.write([received(replace(rows[0], W_import=0.5))]).conflicts == 1
    assert count(engine, quarantine) == 1
    with engine.connect() as connection:
        stored = connection.execute(sa.select(power_register).order_by(power_register.c.filetime)).mappings().first()
    assert {name: stored[name] for name in NUMBERS} == READINGS
    assert maintain(engine, Retention(rollup_1min_days=1), T0 + 3 * 86_400).rollup_deleted >= 6
    assert count(engine, power_register) == 0


@pytest.mark.parametrize("payload", [b"{", b'{"device": "cell1"}'])
def test_what_is_no_row_goes_to_quarantine(tmp_path, payload):
    engine = open_database(str(tmp_path / "a.sqlite"))
    assert Writer(engine).write([Received("acqd/cell1/L1/registers", payload)]).quarantined == 1
