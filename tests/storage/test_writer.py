"""Rows from messages to the table, on SQLite and on a real PostgreSQL."""

from __future__ import annotations

import json

import orjson
import pytest
import sqlalchemy as sa
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from acqd.storage.allowance import Allowance
from acqd.storage.database import open_database
from acqd.storage.received import Received
from acqd.storage.schema import power, quarantine
from acqd.storage.writer import Writer
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.row_message import joined, payloads_of
from acqd.telemetry.spool import Stream
from tests.storage.rows import T0, count, message, row


def test_rows_come_back_as_they_went_in(database):
    engine = open_database(database)
    sent = [row(0), row(1, flags=["gap", "late"], f=None, PF=None), row(2, channel="total")]
    Writer(engine).write([message(r) for r in sent])
    with engine.connect() as connection:
        stored = connection.execute(sa.select(power).order_by(power.c.seq)).mappings().all()
    for r, s in zip(sent, stored, strict=True):
        expected = structs.asdict(r)
        if engine.dialect.name == "postgresql":
            assert s["time"].isoformat() == "2023-11-14T22:15:00+00:00"
        else:
            assert s["time"] == r.time
        assert {k: v for k, v in s.items() if k != "time"} == {k: v for k, v in expected.items() if k != "time"}


def test_the_same_rows_twice_are_stored_once(database):
    engine = open_database(database)
    writer = Writer(engine)
    messages = [message(row(k)) for k in range(100)]
    writer.write(messages)
    written = writer.write([*messages[50:], message(row(100)), message(row(100))])
    assert written.rows == 52 and count(engine) == 101


def test_malformed_messages_go_to_quarantine_with_the_reason_and_stop_nothing(database):
    engine = open_database(database)
    wrong_topic = Received("acqd/other/L1/power", row(1).to_json())
    bad = [Received("acqd/cell1/L1/power", b'{"device": 3}'), Received("acqd/x/L1/power", b"\x00\xff"), wrong_topic]
    written = Writer(engine).write([message(row(0)), *bad])
    assert (written.rows, written.quarantined) == (1, 3) and count(engine) == 1
    with engine.connect() as connection:
        stored = connection.execute(sa.select(quarantine).order_by(quarantine.c.id)).all()
    assert "device" in stored[0].reason and stored[1].payload == b"\x00\xff" and "another topic" in stored[2].reason


def test_a_window_is_stored_row_by_row_and_what_is_wrong_in_it_alone_is_set_aside(database):
    engine = open_database(database)
    good, foreign = [row(k, channel) for k in range(2) for channel in ("L1", "total")], row(9)
    foreign.device = "cell2"
    payloads = [one.to_json() for one in good]
    window = Received("acqd/cell1/window", joined([*payloads, b'{"device":3}', foreign.to_json()]))
    none, poison = Received("acqd/cell1/window", b'{"device":3'), row(5, boot="a\0b")
    written = Writer(engine).write([window, none, message(poison), Received("acqd/cell1/window", joined(payloads))])
    assert count(engine) == 4 and count(engine, quarantine) == written.quarantined == 4
    assert written.receipts[Stream("cell1", "total", good[0].boot)] == Ranges([(0, 1)])


@given(st.lists(st.binary(max_size=30).map(lambda data: orjson.dumps({"k": data.hex()})), max_size=9), st.binary())
def test_windows_come_apart_as_they_were_joined_and_nothing_else_is_one(payloads, other):
    assert payloads_of("acqd/t/window", joined(payloads)) == payloads
    assert payloads_of("acqd/t/L1/power", other) == [other]
    try:
        assert isinstance(orjson.loads(joined([other])), list)
    except ValueError:
        with pytest.raises(ValueError, match="JSON array"):
            payloads_of("acqd/t/window", joined([other]))


def test_a_flood_of_malformed_messages_fills_its_share_and_conflicts_are_kept_all_the_same(database, caplog):
    engine = open_database(database)
    writer = Writer(engine, malformed_bytes_per_day=5_000)
    flood = [Received("acqd/x/L1/power", b"%04d" % k * 100) for k in range(50)]
    assert writer.write([message(row(0)), *flood]).quarantined == 50
    assert 0 < count(engine, quarantine) * 400 <= 5_000
    kept = count(engine, quarantine)
    writer.write([*flood[20:], message(row(0, P=1.0))])
    assert count(engine, quarantine) == kept + 1 and count(engine) == 1
    assert caplog.text.count("only counted") == 1


@given(st.lists(st.tuples(st.floats(0, 40_000), st.lists(st.integers(0, 70_000), max_size=9)), max_size=40))
def test_no_more_bytes_are_kept_than_the_days_that_have_passed_allow(batches):
    now = kept = 0.0
    allowance = Allowance(100_000, clock=lambda: now)
    for pause, sizes in batches:
        now += pause
        fitting = sizes[: allowance.fitting(sizes)]
        allowance.spend(fitting)
        kept += sum(fitting)
        assert kept <= 100_000 * (1 + now / 86_400) + 1e-6


def test_a_row_the_database_cannot_hold_is_set_aside_alone(database):
    engine = open_database(database)
    poison = [message(row(50, time="0000-01-01T00:00:00Z")), message(row(51, boot="a\0b"))]
    messages = [*(message(row(k)) for k in range(100, 200)), *poison, *(message(row(k)) for k in range(40))]
    written = Writer(engine).write(messages)
    assert written.rows + written.quarantined == 142 and count(engine) == written.rows >= 140
    assert count(engine, quarantine) == written.quarantined >= 1


def test_flags_are_json(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(row(0, flags=["gap"]))])
    with engine.connect() as connection:
        assert json.loads(connection.exec_driver_sql("SELECT flags FROM power").scalar()) == ["gap"]


def test_a_stored_key_with_other_values_is_a_conflict_kept_once_in_quarantine(database):
    engine = open_database(database)
    writer = Writer(engine)
    first = writer.write([message(row(k)) for k in range(10)])
    assert (first.rows, first.conflicts) == (10, 0)
    changed = [row(3, P=1.0), row(4, flags=["gap"]), row(5, f=None), row(6, time="2023-11-14T22:15:09Z")]
    for _ in range(2):
        again = writer.write([message(row(2)), *(message(r) for r in changed), message(row(20))])
        assert (again.rows, again.quarantined, again.conflicts) == (2, 4, 4)
        assert sum(len(ranges) for ranges in again.receipts.values()) == 6, "a conflict is not sent again"
    assert count(engine) == 11 and count(engine, quarantine) == 4
    with engine.connect() as connection:
        stored = connection.execute(sa.select(power.c.P).where(power.c.seq == 3)).scalar()
    assert stored == 280.0


def test_two_rows_with_one_key_in_one_batch(database):
    engine = open_database(database)
    written = Writer(engine).write([message(row(1)), message(row(1, P=2.0)), message(row(1))])
    assert (written.rows, written.conflicts) == (2, 1) and count(engine) == 1


def test_receipts_name_rows_that_can_never_be_stored_but_no_rows_of_others(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    absurd = message(row(7, P=1e30))
    foreign = Received("acqd/other/L1/power", row(8, P=1e30).to_json())
    huge = Received(message(row(9)).topic, b"{" * 100, oversized=10**8)
    written = Writer(engine).write([absurd, foreign, huge])
    assert {stream.device: list(ranges) for stream, ranges in written.receipts.items()} == {"cell1": [(7, 7)]}
    assert written.quarantined == 3


def test_rows_of_two_daemons_under_one_name_are_flagged_and_those_of_a_restart_are_not(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    writer = Writer(engine)

    def put(boot, *seconds):
        for k in seconds:
            writer.write([message(row(int(k * 25), t=T0 + k, boot=boot))])

    def flagged(boot):
        with engine.connect() as connection:
            query = sa.select(power.c.flags).where(power.c.boot == boot)
            return sum("two_boots" in flags for flags in connection.execute(query).scalars())

    put("a", 0, 1, 2, 3)
    put("b", 5, 6, 7)  # a restart; then what had waited of the boot before it
    put("a", 4, 4.8)
    put("b", 8, 9)
    assert not writer.boots.trouble and flagged("a") == flagged("b") == 0
    put("c", 10, 11, 12)
    put("b", 12.04)
    put("c", 12.08)
    assert "cell1 (boots b and c)" in writer.boots.trouble and (flagged("b"), flagged("c"), flagged("a")) == (1, 1, 0)
    put("b", 12.04)  # the same row again is no conflict
    assert count(engine, quarantine) == 0
