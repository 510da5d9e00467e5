"""Rows in SQLite by number: every value comes back, in few bytes, and rows of an earlier acqd are moved in place."""

from __future__ import annotations

import json
import sqlite3
from functools import partial

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.config import Config
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from acqd.storage import conversion, known_rows, numbered_rows
from acqd.storage.buckets import stored_span
from acqd.storage.database import MIGRATIONS, engine_for, open_database
from acqd.storage.last_rows import Asked, last_rows
from acqd.storage.maintain import Retention, maintain
from acqd.storage.schema import power, quarantine
from acqd.storage.writer import Writer
from acqd.telemetry.row import PowerRow
from acqd.timestamps import rfc3339, utc_ns
from tests.storage.rows import T0, count, message, row
from tests.telemetry.rows import some_rows

_number = st.none() | st.floats(allow_nan=False, allow_infinity=False)
_rows = st.builds(
    lambda seq, changes, follows: _following(structs.replace(row(seq), **changes), follows),
    st.integers(0, 3) | st.integers(0, 2**63 - 1),
    st.fixed_dictionaries(
        dict.fromkeys(("Vrms", "Irms", "P", "S", "PF", "f", "W"), _number)
        | {
            "channel": st.sampled_from(["L1", "L2", "L3", "total"]),
            "boot": st.sampled_from(["a", "b.1"]),
            "flags": st.lists(st.sampled_from(["gap", "late", "ä"]), unique=True),
            "filetime": st.integers(0, 2**63 - 1) | st.just(row().filetime),
            "time": st.sampled_from([row().time, "2023-11-14T22:15:00Z", "1601-01-01T00:00:00+00:00"]),
        }
    ),
    st.booleans(),
)


def _following(one: PowerRow, follows: bool) -> PowerRow:
    if not follows or one.Vrms is None or one.Irms is None or one.P is None:
        return one
    S = one.Vrms * one.Irms
    return structs.replace(one, S=S if abs(S) < 1e300 else 0.0, PF=one.P / S if 1e-300 < abs(S) < 1e300 else None)


def _stored(engine):
    with engine.connect() as connection:
        stored = connection.execute(sa.select(power).order_by(power.c.boot, power.c.seq, power.c.channel)).mappings()
        return [dict(one) for one in stored]


def _sent(rows):
    return [structs.asdict(one) for one in sorted(rows, key=lambda one: (one.boot, one.seq, one.channel))]


@pytest.fixture(scope="module")
def memory():
    engine = sa.create_engine("sqlite://", poolclass=sa.pool.StaticPool)
    sa.event.listen(engine, "connect", lambda connection, _: setattr(connection, "isolation_level", None))
    from acqd.storage.database import migrate

    migrate(engine)
    sa.event.listen(engine, "begin", lambda connection: connection.exec_driver_sql("BEGIN"))
    return engine


@settings(max_examples=60, deadline=None)
@given(st.lists(_rows, min_size=1, max_size=6, unique_by=lambda one: (one.boot, one.seq, one.channel)))
def test_every_value_comes_back_to_the_last_bit(memory, rows):
    from acqd.storage import rows as module

    with memory.begin() as connection:
        connection.exec_driver_sql("DELETE FROM power_row")
        connection.exec_driver_sql("DELETE FROM power_stamp")
        assert module.insert(connection, rows) == []
        assert module.insert(connection, [*reversed(rows)]) == [], "the same rows again are no conflict"
        other = [structs.replace(one, W=(one.W or 0.0) + 1.0 if abs(one.W or 0.0) < 1e9 else None) for one in rows]
        assert module.insert(connection, other) == list(range(len(rows)))
        other = [structs.replace(one, time="2024-01-01T00:00:00Z") for one in rows]
        assert module.insert(connection, other) == list(range(len(rows)))
    assert _stored(memory) == _sent(rows)


def test_of_many_rows_those_that_are_stored_with_other_values_are_told(tmp_path):
    """Many rows go into one statement; some are there already, equal or not, also twice in one batch."""
    engine = open_database(str(tmp_path / "a.sqlite"))
    rows = [row(k) for k in range(200)]
    there = [rows[3], structs.replace(rows[95], P=1.0), rows[120], structs.replace(rows[199], W=None)]
    Writer(engine).write([message(one) for one in there])
    again = structs.replace(rows[7], f=49.0)
    written = Writer(engine).write([message(one) for one in [*rows, again]])
    assert (written.rows, written.conflicts) == (198, 3)
    kept = {(one.boot, one.seq): one for one in [*rows, *there]}
    assert _stored(engine) == [structs.asdict(one) | {"flags": []} for _, one in sorted(kept.items())]


def _size(path):
    """Bytes of a database, without its journal."""
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return path.stat().st_size


def test_a_row_takes_less_than_100_bytes(tmp_path):
    """Of metered mains, three phases and the total; everything that the file holds counted."""
    _, _, rows = some_rows(seconds=4.0)
    windows, ticks = len(rows) // 4, 40_000_000
    rows = [
        structs.replace(
            one,
            seq=one.seq + k * windows,
            filetime=one.filetime + k * ticks,
            time=rfc3339(utc_ns(one.filetime + k * ticks)),
        )
        for k in range(10)
        for one in rows
    ]
    path = tmp_path / "a.sqlite"
    engine = open_database(str(path))
    empty = _size(path)
    writer = Writer(engine)
    for begin in range(0, len(rows), 2_000):
        writer.write([message(one) for one in rows[begin : begin + 2_000]])
    assert (_size(path) - empty) / len(rows) < 100


def test_what_reads_rows_seeks_in_an_index(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(row(k)) for k in range(10)])
    readers = {
        "SELECT time, channel, P FROM power ORDER BY filetime DESC LIMIT 4": "power_row_filetime",
        "SELECT * FROM power WHERE filetime BETWEEN 1 AND 2 AND device = 'cell1'": "power_row_filetime",
        "SELECT * FROM power WHERE device = 'cell1' AND filetime >= 1": "",
        "SELECT count(*) FROM power WHERE device = 'cell1' AND boot = 'b'": "",
    }
    with engine.connect() as connection:
        for query, index in readers.items():
            plan = [one[3] for one in connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {query}")]
            assert not [one for one in plan if one.startswith("SCAN v") and "USING INDEX" not in one], (query, plan)
            assert index in " ".join(plan), (query, plan)
        assert known_rows.devices(connection) == ["cell1"]
        assert known_rows.newest(connection) == row().filetime


def test_the_first_and_the_newest_row_of_a_device_are_found_without_reading_its_rows(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    rows = [row(k, t=1_700_000_000 + k, boot=f"b{k % 3}", device=name) for k in range(600) for name in ("a", "b")]
    Writer(engine).write([message(one) for one in rows])
    times = sorted(one.filetime for one in rows if one.device == "a")
    steps = []
    with engine.connect() as connection:
        connection.connection.driver_connection.set_progress_handler(lambda: steps.append(1) and None, 10)
        assert known_rows.newest(connection, "none") is None and len(steps) > 120
        steps.clear()
        assert known_rows.newest(connection, "a") == known_rows.newest(connection) == times[-1]
        assert known_rows.newest(connection, "a", times[-5]) == times[-5]
        assert connection.exec_driver_sql("SELECT max(filetime) FROM power").scalar() == times[-1]
        assert len(steps) < 60, "fewer instructions than rows"
        steps.clear()
        assert stored_span(connection, "none") is None
        assert stored_span(connection, "a") == (1_700_000_000, 1_700_000_599) and len(steps) < 60


def test_runs_outside_of_a_span_are_not_searched(tmp_path):
    """Of 200 boots one has rows in the span, in one place of the middle."""
    engine = open_database(str(tmp_path / "a.sqlite"))
    rows = [row(k, t=1_700_000_000 + 100 * boot + k, boot=f"b{boot}") for boot in range(200) for k in range(10)]
    Writer(engine).write([message(one) for one in rows])
    statements = []
    sa.event.listen(engine, "before_cursor_execute", lambda *event: statements.append(event[2]))
    with engine.connect() as connection:
        between = partial(numbered_rows.ids_between, connection, "cell1", row().channel)
        first, last = rows[503].filetime, rows[507].filetime
        ((low, high, code),) = between(first, last)
        query = "SELECT filetime FROM power_row WHERE id >= ? AND id < ? AND id & 3 = ?"
        found = connection.exec_driver_sql(query, (low, high, code)).scalars().all()
        assert found == [one.filetime for one in rows[503:507]] and len(statements) < 80
        assert between(rows[9].filetime + 1, rows[10].filetime) == [] and len(between(0, 2**62)) == 200
        assert len(between(rows[9].filetime, rows[10].filetime + 1)) == 2


@pytest.fixture
def earlier(tmp_path):
    """A database of the schema before, with rows of all sorts."""
    (tmp_path / "a.sqlite").touch()
    engine = engine_for(str(tmp_path / "a.sqlite"))
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    rows = [
        *(row(k, channel) for k in range(3) for channel in ("L1", "total")),
        row(3, S=None, PF=None, f=None, flags=["gap", "late"]),
        row(2**40, time="2023-11-14T22:15:00Z"),
        _following(row(5, Vrms=231.0), follows=True),
    ]
    with engine.begin() as connection:
        connection.exec_driver_sql("BEGIN IMMEDIATE")
        config.attributes["connection"] = connection
        command.upgrade(config, "0009")
        connection.execute(sa.insert(power), [structs.asdict(one) for one in rows])
        connection.exec_driver_sql("UPDATE power SET channel = 'N' WHERE seq = 0 AND channel = 'total'")
    rows[1].channel = "N"  # nobody writes such rows; nobody may lose them
    return engine, rows


def test_rows_of_an_earlier_acqd_are_moved_in_place(earlier, tmp_path):
    engine, rows = earlier
    assert _stored(open_database(str(tmp_path / "a.sqlite"))) == _sent(rows)
    with engine.connect() as connection:
        assert not conversion.unfinished(connection)
        assert connection.exec_driver_sql("SELECT count(*) FROM power_stamp").scalar() == 1


def test_the_move_can_be_interrupted_and_rows_come_meanwhile(earlier, tmp_path, monkeypatch):
    engine, rows = earlier
    monkeypatch.setattr(conversion, "_AT_ONCE", 4)
    monkeypatch.setattr("acqd.storage.database._CONVERTED_AT_ONCE", 4)
    engine = open_database(str(tmp_path / "a.sqlite"))
    with engine.connect() as connection:
        assert conversion.unfinished(connection)
    assert _stored(engine) == _sent(rows), "those that are moved and those that are not"
    writer = Writer(engine)
    new = row(100, t=T0 + 10)
    written = writer.write([message(one) for one in (rows[-1], rows[0], new)])
    assert written.conflicts == 0 and _stored(engine) == _sent([*rows, new])
    assert writer.write([message(structs.replace(rows[3], W=9.0))]).conflicts == 1
    assert count(engine, quarantine) == 1
    with engine.connect() as connection:
        assert [one.seq for one in last_rows(connection, Asked("cell1", "boot1"))] != []
    maintain(engine, Retention(0, 0, 0), T0 + 100)
    with engine.connect() as connection:
        assert not conversion.unfinished(connection)
    assert _stored(engine) == _sent([*rows, new])


def test_sql_inserts_changes_and_deletes_rows_as_in_a_table(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(row(k, flags=["gap"], time="2023-11-14T22:15:00Z")) for k in range(4)])
    before = _stored(engine)
    with engine.begin() as connection:
        connection.exec_driver_sql("INSERT INTO power SELECT 'copy', channel, boot, seq, time, filetime, Vrms, Irms, P,"
            " S, PF, f, W, flags, schema FROM power")  # fmt: skip
        assert connection.exec_driver_sql("SELECT count(*), max(seq) FROM power").one() == (8, 3)
        connection.exec_driver_sql("DELETE FROM power WHERE device = 'cell1'")
        assert connection.exec_driver_sql("SELECT DISTINCT device FROM power").scalars().all() == ["copy"]
        connection.exec_driver_sql("UPDATE power SET device = 'cell1' WHERE device = 'copy'")
    assert _stored(engine) == before
    with engine.connect() as connection:
        assert [
            connection.exec_driver_sql(f"SELECT count(*) FROM power_{one}").scalar() for one in ("row", "stamp")
        ] == [
            4,
            4,
        ]
    assert Writer(engine).write([message(row(0, flags=["gap"], time="2023-11-14T22:15:00Z"))]).conflicts == 0
    with engine.connect() as connection:
        query = "SELECT flags FROM power WHERE seq = 1"
        assert json.loads(connection.exec_driver_sql(query).scalar_one()) == ["gap"]


def test_the_last_rows_of_a_boot_are_those_of_its_continuation(database):
    engine = open_database(database)
    rows = [row(k, channel, boot=boot) for k, boot in enumerate(("a", "a.1", "ab")) for channel in ("L1", "total")]
    Writer(engine).write([message(one) for one in [*rows, row(9, boot="a.1", W=None)]])
    with engine.connect() as connection:
        last = last_rows(connection, Asked("cell1", "a"))
        assert {(one.channel, one.boot, one.seq, one.W) for one in last} == {
            ("L1", "a.1", 1, 0.001), ("total", "a.1", 1, 0.001)
        }  # fmt: skip
        assert last_rows(connection, Asked("cell1", "x")) == last_rows(connection, Asked("x", "a")) == []
