"""The sink between a real broker and a real database."""

from __future__ import annotations

import threading
from contextlib import contextmanager

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.storage.database import open_database
from acqd.storage.schema import quarantine
from acqd.storage.sink import Sink, SinkSettings
from acqd.storage.writer import Writer
from acqd.telemetry.mqtt import BrokerAddress
from tests.storage.rows import count, message, row
from tests.waiting import LIMIT_S, wait_for


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
        thread.join(LIMIT_S)


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
        info.wait_for_publish(LIMIT_S)


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
        wait_for(lambda: sink.counters.reconnects >= 1, "the sink gives up a batch and reconnects")
        assert sink.counters.rows == 0
        with engine.connect() as connection:
            connection.exec_driver_sql("ALTER TABLE hidden RENAME TO power")
            connection.commit()
        wait_for(lambda: count(engine) == 201, "all rows after the database is back")


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
