"""Voltage events in SQL: one row per event, whatever comes twice, late or broken."""

from __future__ import annotations

import dataclasses
import json

import pytest
import sqlalchemy as sa

from acqd.storage.database import open_database
from acqd.storage.received import Received
from acqd.storage.schema import power_event, quarantine
from acqd.storage.writer import Writer
from acqd.telemetry.event import PowerEvent, parse_event
from acqd.telemetry.spool import Stream
from acqd.timestamps import filetime, rfc3339
from tests.storage.rows import count, message, row

NS = 1_700_000_000 * 10**9


def event(number=0, duration: float | None = 0.1, **changes) -> PowerEvent:
    base = PowerEvent(
        "cell1",
        "boot1",
        number,
        "dip",
        rfc3339(NS),
        filetime(NS),
        duration,
        161.0,
        230.0,
        False,
        None,
        ["L1"],
        [],
        None,
    )
    return dataclasses.replace(base, **changes)


def sent(one: PowerEvent, topic="acqd/cell1/event") -> Received:
    return Received(topic, one.to_json())


@pytest.fixture
def engine(tmp_path):
    return open_database(str(tmp_path / "x.sqlite"))


def stored(engine):
    with engine.connect() as connection:
        return [dict(one._mapping) for one in connection.execute(sa.select(power_event).order_by("number"))]


def test_the_end_replaces_the_begin_and_a_late_begin_changes_nothing(engine):
    Writer(engine).write([sent(event(duration=None, extreme=199.0))])
    assert stored(engine)[0]["duration"] is None
    Writer(engine).write([sent(event()), message(row())])
    Writer(engine).write([sent(event(duration=None, extreme=199.0))])
    (one,) = stored(engine)
    assert (one["duration"], one["extreme"], one["phases"]) == (0.1, 161.0, ["L1"])
    assert count(engine) == 1


def test_either_database_keeps_one_event(database):
    engine = open_database(database)
    for one in (event(duration=None, phases=[]), event(flags=["gap"]), event(duration=None)):
        Writer(engine).write([sent(one), sent(event(1, duration=None)), message(row())])
    first, second = stored(engine)
    assert (first["duration"], first["flags"], second["duration"]) == (0.1, ["gap"], None)
    assert count(engine) == 1


def test_begin_and_end_may_come_in_one_batch(engine):
    Writer(engine).write([sent(event(duration=None)), sent(event(1)), sent(event())])
    assert [one["duration"] for one in stored(engine)] == [0.1, 0.1]


def test_every_message_has_a_receipt_also_one_that_nobody_can_store(engine):
    wrong = Received("acqd/cell1/event", json.dumps(json.loads(event(5).to_json()) | {"kind": "sag"}).encode())
    written = Writer(engine).write([sent(event(duration=None)), sent(event(3)), wrong, message(row())])
    assert list(written.receipts[Stream("cell1", "event", "boot1")]) == [(0, 0), (7, 7), (11, 11)]


def test_another_end_of_a_stored_event_goes_into_quarantine(database):
    engine = open_database(database)
    Writer(engine).write([sent(event())])
    other = event(extreme=150.0)
    written = Writer(engine).write([sent(event()), sent(other), sent(event(duration=None))])
    assert written.quarantined == 1 and stored(engine)[0]["extreme"] == 161.0
    assert list(written.receipts[Stream("cell1", "event", "boot1")]) == [(0, 1)]
    with engine.connect() as connection:
        assert bytes(connection.execute(sa.select(quarantine.c.payload)).scalar()) == other.to_json()


@pytest.mark.parametrize(
    "change",
    [{"kind": "sag"}, {"duration": -1}, {"extreme": "x"}, {"phases": ["L9"]}, {"time": "then"}, {"reference": 0},
     {"filetime": filetime(10**18 * 8)}, {"number": -1}, {"device": "other"}, {"schema": 2}, {"flags": None}],
)  # fmt: skip
def test_what_is_no_event_goes_into_quarantine_and_its_neighbours_are_stored(engine, change):
    wrong = Received("acqd/cell1/event", json.dumps(json.loads(event(5).to_json()) | change).encode())
    written = Writer(engine).write([sent(event()), wrong, message(row())])
    assert written.quarantined == 1 and written.rows == 1
    assert len(stored(engine)) == 1 and count(engine, quarantine) == 1


@pytest.mark.parametrize("payload", [b"", b"[", b"{}", b"null", b"[" * 100_000, b'"\\u0000"', b"\xff"])
def test_broken_payloads_are_refused_in_one_line(payload):
    with pytest.raises(ValueError) as refusal:
        parse_event(payload)
    assert "\n" not in str(refusal.value)
