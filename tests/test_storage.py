"""The sink and its database, on SQLite and on a real PostgreSQL."""

from __future__ import annotations

import dataclasses
import json
import threading
from contextlib import contextmanager

import paho.mqtt.client as paho
import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from paho.mqtt.enums import CallbackAPIVersion

from acqd.errors import UserError
from acqd.storage.database import open_database
from acqd.storage.maintain import Retention, maintain
from acqd.storage.schema import metadata, power, power_1min, power_15min, quarantine
from acqd.storage.sink import Sink, SinkSettings
from acqd.storage.writer import Received, Writer
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.row import PowerRow
from acqd.timestamps import filetime, rfc3339

from .conftest import wait_for

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
    return dataclasses.replace(base, **changes)


def message(r: PowerRow) -> Received:
    return Received(f"acqd/{r.device}/{r.channel}/power", r.to_json())


def count(engine, table=power) -> int:
    with engine.connect() as connection:
        return connection.execute(sa.select(sa.func.count()).select_from(table)).scalar()


def test_rows_come_back_as_they_went_in(database):
    engine = open_database(database)
    sent = [row(0), row(1, flags=["gap", "late"], f=None, PF=None), row(2, channel="total")]
    Writer(engine).write([message(r) for r in sent])
    with engine.connect() as connection:
        stored = connection.execute(sa.select(power).order_by(power.c.seq)).mappings().all()
    for r, s in zip(sent, stored, strict=True):
        expected = dataclasses.asdict(r)
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


def test_a_row_the_database_cannot_hold_is_set_aside_alone(database):
    engine = open_database(database)
    poison = [message(row(50, time="0000-01-01T00:00:00Z")), message(row(51, boot="a\0b"))]
    messages = [*(message(row(k)) for k in range(100, 200)), *poison, *(message(row(k)) for k in range(40))]
    written = Writer(engine).write(messages)
    assert written.rows + written.quarantined == 142 and count(engine) == written.rows >= 140
    assert count(engine, quarantine) == written.quarantined >= 1


def test_migrations_give_exactly_the_declared_schema(database):
    engine = open_database(database)
    with engine.connect() as connection:
        options = {"compare_type": False}
        difference = compare_metadata(MigrationContext.configure(connection, opts=options), metadata)
    assert [entry for entry in difference if entry[0] != "remove_index"] == []


def test_opening_again_and_from_several_sinks_at_once_is_harmless(database):
    errors = []

    def open_it():
        try:
            open_database(database).dispose()
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=open_it) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    assert count(open_database(database)) == 0


@pytest.mark.parametrize(
    ("url", "complaint"),
    [("sqlite:////nowhere/at/all/x.sqlite", "does not exist"), ("oracle://x/y", "expected sqlite"),
     ("://", "cannot be understood"),
     ("postgresql://u:x@h:abc/z", "cannot be understood"),
     ("postgresql://acqd@127.0.0.1:1/x", "check host")],
)  # fmt: skip
def test_unusable_databases_are_named(url, complaint):
    with pytest.raises(UserError, match=complaint):
        open_database(url)


def test_a_file_that_is_no_database_is_named_and_left_alone(tmp_path):
    path = tmp_path / "a.sqlite"
    path.write_bytes(b"not a database, but somebody's file" * 100)
    with pytest.raises(UserError, match=r"a\.sqlite"):
        open_database(str(path))
    assert path.read_bytes().startswith(b"not a database")


def test_roll_ups_and_retention(database):
    engine = open_database(database)
    day = 86_400
    rows = [
        row(k, t=T0 + k * 2.0, W=0.001 * k, Vrms=230.0 + (k % 2), flags=["gap"] if k == 3 else []) for k in range(1_000)
    ]
    Writer(engine).write([message(r) for r in rows])
    now = T0 + 1_000 * 2.0
    first = maintain(engine, Retention(power_days=0), now)
    assert (first.rollup_1min, first.rollup_15min) == (33, 2)
    with engine.connect() as connection:
        minute = connection.execute(sa.select(power_1min).order_by(power_1min.c.start)).mappings().first()
        quarters = connection.execute(sa.select(power_15min).order_by(power_15min.c.start)).mappings().all()
    assert minute["start"] == T0 and minute["rows"] == 30 and minute["flagged"] == 1
    assert minute["P"] == pytest.approx(280.0) and minute["W"] == pytest.approx(0.029)
    assert minute["Vrms"] == pytest.approx(((230.0**2 + 231.0**2) / 2) ** 0.5)
    assert minute["PF"] == pytest.approx(280.0 / 288.1)
    assert [q["rows"] for q in quarters] == [450, 450]

    # A late row changes its bucket; running again changes nothing else.
    Writer(engine).write([message(row(5_000, t=T0 + 1.0, P=580.0))])
    maintain(engine, Retention(power_days=0), now)
    with engine.connect() as connection:
        minute = connection.execute(sa.select(power_1min).order_by(power_1min.c.start)).mappings().first()
    assert minute["rows"] == 31 and minute["P_max"] == 580.0

    # Deleting keeps the roll-ups.
    later = maintain(engine, Retention(power_days=1.0, rollup_1min_days=2.0), T0 + 950 + day)
    assert later.power_deleted == 451 and count(engine) == 550
    gone = maintain(engine, Retention(power_days=1.0, rollup_1min_days=2.0), T0 + 3 * day)
    assert count(engine) == 0 and gone.rollup_deleted == count(engine, power_1min) + gone.rollup_deleted
    assert count(engine, power_15min) == 3


def test_a_backlog_of_days_is_rolled_up_before_it_is_deleted(database):
    engine = open_database(database)
    day = 86_400
    now = T0 + 100 * day
    recent = [row(k, t=now - 3_600 + k) for k in range(200)]
    Writer(engine).write([message(r) for r in recent])
    maintain(engine, Retention(power_days=30), now)
    old = [row(k, t=T0 + 40 * day + k, device="cell2", Vrms=1e-200) for k in range(120)]
    Writer(engine).write([Received("acqd/cell2/L1/power", r.to_json()) for r in old])
    done = maintain(engine, Retention(power_days=30), now)
    assert done.power_deleted == 120
    with engine.connect() as connection:
        stored = connection.execute(sa.select(power_1min.c.rows).where(power_1min.c.device == "cell2")).scalars().all()
    assert stored == [60, 60]


@contextmanager
def running_sink(address, engine, **settings):
    sink = Sink(address, engine, SinkSettings(interval=0.05, **settings))
    stop = threading.Event()
    thread = threading.Thread(target=sink.run, args=(stop.is_set,))
    thread.start()
    try:
        wait_for(lambda: sink.connected, "the sink connects")
        yield sink
    finally:
        stop.set()
        thread.join(10)


@contextmanager
def publisher(port):
    client = paho.Client(CallbackAPIVersion.VERSION2)
    client.max_inflight_messages_set(1_000)
    client.connect("127.0.0.1", port)
    client.loop_start()
    yield client
    client.loop_stop()
    client.disconnect()


def publish(client, rows):
    infos = [client.publish(message(r).topic, message(r).payload, qos=1) for r in rows]
    for info in infos:
        info.wait_for_publish(10)


def test_sink_from_broker_to_table(mosquitto, database):
    engine = open_database(database)
    with running_sink(BrokerAddress(port=mosquitto.port), engine) as sink, publisher(mosquitto.port) as client:
        publish(client, [row(k) for k in range(500)])
        client.publish("acqd/cell1/L1/power", b"{}", qos=1)
        wait_for(lambda: sink.counters.rows == 500 and sink.counters.quarantined == 1, "500 rows and a refusal")
    assert count(engine) == 500 and count(engine, quarantine) == 1


def test_nothing_is_acknowledged_before_the_commit(mosquitto, database):
    """While the database is locked away the broker keeps the rows; afterwards they all arrive."""
    engine = open_database(database)
    Writer(engine).write([message(row(10_000))])
    with engine.connect() as connection:
        connection.exec_driver_sql("ALTER TABLE power RENAME TO hidden")
        connection.commit()
    with running_sink(BrokerAddress(port=mosquitto.port), engine) as sink, publisher(mosquitto.port) as client:
        publish(client, [row(k) for k in range(200)])
        wait_for(lambda: sink.counters.reconnects >= 1, "the sink gives up a batch and reconnects", 20)
        assert sink.counters.rows == 0
        with engine.connect() as connection:
            connection.exec_driver_sql("ALTER TABLE hidden RENAME TO power")
            connection.commit()
        wait_for(lambda: count(engine) == 201, "all rows after the database is back", 20)


def test_rows_sent_while_the_sink_is_away_wait_at_the_broker(mosquitto, database):
    engine = open_database(database)
    address = BrokerAddress(port=mosquitto.port)
    with running_sink(address, engine):
        pass
    with publisher(mosquitto.port) as client:
        publish(client, [row(k) for k in range(300)])
    with running_sink(address, engine):
        wait_for(lambda: count(engine) == 300, "the rows that waited")


def test_rows_survive_a_restart_of_the_broker_before_the_sink_is_back(mosquitto, tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    address = BrokerAddress(port=mosquitto.port)
    with running_sink(address, engine):
        pass
    for start in (0, 100):
        with publisher(mosquitto.port) as client:
            publish(client, [row(k) for k in range(start, start + 100)])
        mosquitto.stop()
        mosquitto.start()
    with running_sink(address, engine):
        wait_for(lambda: count(engine) == 200, "the rows from before, between and after")


def test_a_backlog_larger_than_a_batch_arrives(mosquitto, tmp_path):
    """The broker sends the backlog before it confirms the subscription."""
    engine = open_database(str(tmp_path / "a.sqlite"))
    address = BrokerAddress(port=mosquitto.port)
    with running_sink(address, engine, batch=50):
        pass
    with publisher(mosquitto.port) as client:
        publish(client, [row(k) for k in range(400)])
    with running_sink(address, engine, batch=50):
        wait_for(lambda: count(engine) == 400, "a backlog of eight batches")


def test_several_sinks_share_the_work(mosquitto, database):
    engine = open_database(database)
    address = BrokerAddress(port=mosquitto.port)
    with (
        running_sink(address, engine, client_id="one", group="g") as one,
        running_sink(address, engine, client_id="two", group="g") as two,
        publisher(mosquitto.port) as client,
    ):
        publish(client, [row(k) for k in range(400)])
        wait_for(lambda: one.counters.rows + two.counters.rows == 400, "400 rows between two sinks")
        assert one.counters.rows and two.counters.rows
    assert count(engine) == 400


def test_flags_are_json(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(row(0, flags=["gap"]))])
    with engine.connect() as connection:
        assert json.loads(connection.exec_driver_sql("SELECT flags FROM power").scalar()) == ["gap"]
