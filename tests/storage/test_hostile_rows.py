"""Rows that a stranger has made up must not cost genuine ones."""

from __future__ import annotations

import json
import time

import pytest
import sqlalchemy as sa

from acqd.storage.database import open_database
from acqd.storage.received import Received
from acqd.storage.schema import power, quarantine
from acqd.storage.writer import Writer
from acqd.telemetry import topics
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.row import PowerRow
from acqd.timestamps import filetime, rfc3339


def message(seq, ns, P=100.0):
    row = PowerRow("box", "L1", "b1", seq, rfc3339(ns), filetime(ns), 230.0, 1.0, P, 230.0, 0.4, 50.0, 1.0, [])
    return Received(topics.power("box", "L1"), row.to_json())


def held(engine, table):
    with engine.connect() as connection:
        return connection.execute(sa.select(table)).all()


@pytest.mark.parametrize("days", [-36500, 36500, 2])
def test_rows_far_from_now_go_into_quarantine(database, days):
    engine = open_database(database)
    now = time.time_ns()
    Writer(engine).write([message(1, now + days * 86_400 * 10**9), message(2, now)])
    assert [row.seq for row in held(engine, power)] == [2]
    assert len(held(engine, quarantine)) == 1


def test_a_genuine_row_whose_key_a_stranger_has_taken_is_not_dropped_silently(database):
    engine, now = open_database(database), time.time_ns()
    Writer(engine).write([message(7, now, P=-1.0)])  # the stranger knows the boot from the status topic
    Writer(engine).write([message(7, now, P=250.0)])
    assert [row.P for row in held(engine, power)] == [-1.0]
    assert len(held(engine, quarantine)) == 1  # the other values are told


def test_the_same_row_again_is_no_conflict(database):
    engine, now = open_database(database), time.time_ns()
    for _ in range(2):
        Writer(engine).write([message(7, now)])
    assert len(held(engine, power)) == 1 and not held(engine, quarantine)


ODD = (None, True, False, -1, 2**63, 1e308, 1.5, -0.0, "x", "", "é", "NaN", [], {}, [[1]], "a" * 70_000, "\0", {"a": 1})
DEVICES = ("a/b", "+", "#", "ü", "x" * 200, "..", "", " ", "a\nb", "$SYS")


def test_no_value_of_a_wrong_type_ends_the_sink_or_takes_a_receipt(database):
    engine = open_database(database)
    writer = Writer(engine)
    base = json.loads(message(0, time.time_ns()).payload)
    bad = [{**base, "seq": 10 + k, key: value} for key in base for k, value in enumerate(ODD)]
    sent = [Received(topics.power("box", "L1"), json.dumps(one).encode()) for one in bad]
    sent += [
        Received(f"acqd/{name}/{kind}", json.dumps({**base, "device": name, "number": None, "duration": 0}).encode())
        for name in DEVICES
        for kind in ("L1/power", "window", "event", "L1/quality", "L1/registers")
    ]
    written = writer.write(sent)
    assert written.rows + written.quarantined == len(sent) and not written.waiting
    assert writer.write(sent).rows == written.rows == len(held(engine, power))


@pytest.mark.parametrize("seq", [1.0, 1.5, True, "1", [1], None, -1, 2**63])
def test_a_number_that_is_no_number_of_a_row_takes_no_receipt_of_another(tmp_path, seq):
    writer = Writer(open_database(str(tmp_path / "a.sqlite")))
    base = json.loads(message(0, time.time_ns()).payload)
    for changes in ({"seq": seq}, {"seq": seq, "channel": None}, {"seq": seq, "device": ["box"]}):
        one = Received(topics.power("box", "L1"), json.dumps({**base, "P": "x", **changes}).encode())
        assert not any(rows != Ranges() for rows in writer.write([one]).receipts.values())
