"""The sink between a real broker and a real database."""

from __future__ import annotations

import json
import subprocess
import threading
import time
from contextlib import contextmanager

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from acqd.storage.database import open_database
from acqd.storage.schema import quarantine
from acqd.storage.sink import Sink
from acqd.storage.sink_settings import SinkSettings
from acqd.storage.writer import Writer
from acqd.telemetry.broker import free_port
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.receipts import parse_receipt, ranges_of
from tests.commands import ACQD
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
        table = "power" if engine.dialect.name == "postgresql" else "power_row"
        connection.exec_driver_sql(f"ALTER TABLE {table} RENAME TO hidden")
        connection.commit()
    with running_sink(BrokerAddress(port=mosquitto.port), engine) as sink, publisher(mosquitto.port) as client:
        publish(client, [row(k) for k in range(200)])
        time.sleep(0.5)
        assert sink.counters.rows == 0 and sink.counters.reconnects == 0
        with engine.connect() as connection:
            connection.exec_driver_sql(f"ALTER TABLE hidden RENAME TO {table}")
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


def test_a_commit_that_does_not_end_is_a_lag(mosquitto, tmp_path):
    engine = open_database(f"sqlite:///{tmp_path / 'test.sqlite'}")
    with running_sink(BrokerAddress(port=mosquitto.port), engine) as sink, publisher(mosquitto.port) as client:
        go_on, write = threading.Event(), sink._writer.write
        sink._writer.write = lambda messages: go_on.wait(LIMIT_S) and write(messages)
        client.publish(message(row(0)).topic, message(row(0)).payload, qos=1)
        wait_for(lambda: sink.counters.lag_s > 0.6, "the lag grows while the commit lasts")
        assert sink.counters.rows == 0
        go_on.set()
        wait_for(lambda: count(engine) == 1, "the row is stored")


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


def test_two_sinks_of_one_client_id_both_say_so_also_while_they_are_connected(mosquitto, tmp_path):
    """The broker takes the connection from the one when the other comes."""

    def named(sink):
        for _ in range(5):
            if not (sink.connected and "another sink" in sink.counters.broker_trouble):
                return False
            time.sleep(0.02)
        return True

    address = BrokerAddress(port=mosquitto.port)
    engines = [open_database(str(tmp_path / f"{name}.sqlite")) for name in "ab"]
    with (
        running_sink(address, engines[0], client_id="s") as first,
        running_sink(address, engines[1], client_id="s") as second,
    ):
        for sink in (first, second):
            wait_for(lambda sink=sink: named(sink), "a name that is taken")
    with running_sink(address, engines[0], client_id="s") as alone:
        wait_for(lambda: alone.connected and not alone.counters.broker_trouble, "a name that nobody else has")


@pytest.mark.parametrize("mqtt5", [True, False])
def test_messages_that_are_too_large_stop_nothing(mosquitto, tmp_path, mqtt5):
    """With MQTT 5 the broker does not even send them; with 3.1.1 they are cut, and kept in quarantine."""
    engine = open_database(str(tmp_path / "a.sqlite"))
    address = BrokerAddress(port=mosquitto.port)
    with running_sink(address, engine, mqtt5=mqtt5) as sink, publisher(mosquitto.port) as client:
        for _ in range(3):
            client.publish("acqd/cell1/L1/power", b"x" * 5_000_000, qos=1)
        publish(client, [row(k) for k in range(100)])
        wait_for(lambda: sink.counters.rows == 100, "the rows behind them")
        assert sink.counters.reconnects == 0 and sink.counters.quarantined == (0 if mqtt5 else 3)


def test_a_refused_password_is_said_and_tried_again(mosquitto, tmp_path, caplog):
    mosquitto.stop()
    mosquitto.extra = "allow_anonymous false\n"
    mosquitto.start()
    engine = open_database(str(tmp_path / "a.sqlite"))
    sink, stop = Sink(BrokerAddress(port=mosquitto.port, username="a", password="b"), engine), threading.Event()
    thread = threading.Thread(target=sink.run, args=(stop.is_set,))
    thread.start()
    wait_for(lambda: "refused the connection" in caplog.text, "the refusal is said")
    assert sink.counters.broker_trouble in ("not authorized", "bad user name or password")
    mosquitto.stop()
    mosquitto.extra = "allow_anonymous true\n"
    mosquitto.start()
    wait_for(lambda: sink.connected, "the sink connects")
    assert caplog.text.count("refused the connection") == 1
    wait_for(lambda: not sink.counters.broker_trouble, "nothing is wrong any more")
    stop.set()
    thread.join(LIMIT_S)


def test_receipts_and_the_announcement(mosquitto, tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    heard = []
    with publisher(mosquitto.port) as client:
        client.on_message = lambda _client, _data, message: heard.append((message.topic, message.payload))
        client.subscribe([("acqd/+/receipt", 1), ("acqd/sink/+/status", 1)])
        with running_sink(BrokerAddress(port=mosquitto.port), engine, client_id="s/1"):
            publish(client, [row(k) for k in (0, 1, 2, 5)])
            wait_for(lambda: any(topic == "acqd/cell1/receipt" for topic, _ in heard), "a receipt")
        wait_for(lambda: heard[-1] == ("acqd/sink/s-1/status", b"offline"), "the farewell")
    assert heard[0][0] == "acqd/sink/s-1/status" and json.loads(heard[0][1])["sink"] == "s/1"
    ranges = Ranges()
    for topic, payload in heard:
        for stream, first, last in ranges_of("cell1", parse_receipt(payload)) if topic.endswith("receipt") else ():
            assert stream == ("cell1", "L1", "boot1")
            ranges.add(first, last)
    assert list(ranges) == [(0, 2), (5, 5)]


def test_the_announcement_names_for_which_event_rows_were_asked_for_also_after_a_restart(mosquitto, tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    said, events = [], set()
    with publisher(mosquitto.port) as client:
        client.on_message = lambda _client, _data, message: said.append(message.payload)
        client.subscribe("acqd/sink/s/status", 1)
        for seq in (0, 1):
            with running_sink(BrokerAddress(port=mosquitto.port), engine, client_id="s"):
                publish(client, [row(seq)])
                wait_for(lambda: any(b'"recalled"' in one for one in said), "the name of the event")
            wait_for(lambda: said[-1] == b"offline", "the farewell")
            named = [json.loads(one) for one in said if b'"recalled"' in one]
            said.clear()
            assert [one for one in named if one.get("recall")] == (named[:1] if not seq else [])
            events |= {one["recalled"] for one in named}
    assert len(events) == 1


def test_a_new_database_is_announced_before_the_first_row(mosquitto, tmp_path):
    """Later, rows that it has stored would be sent again, and the daemon would warn of a loss that has not happened."""
    engine, said = open_database(str(tmp_path / "a.sqlite")), []
    with publisher(mosquitto.port) as client:
        client.on_message = lambda _client, _data, message: said.append(message.payload)
        client.subscribe("acqd/sink/s/status", 1)
        with running_sink(BrokerAddress(port=mosquitto.port), engine, client_id="s"):
            wait_for(lambda: any(b'"recall"' in one for one in said), "the event, without a row")


def test_a_broker_that_does_not_answer_to_mqtt_5_is_asked_by_3_1_1(tmp_path, monkeypatch):
    """The embedded broker, which the sink does not know to be one."""
    monkeypatch.setattr("acqd.telemetry.subscriber._ANSWER_S", 0.5)
    port = free_port()
    broker = subprocess.Popen([*ACQD, "broker", "--port", str(port)], stdout=subprocess.PIPE)
    broker.stdout.readline()
    engine = open_database(str(tmp_path / "a.sqlite"))
    with running_sink(BrokerAddress(port=port), engine) as sink, publisher(port) as client:
        publish(client, [row(k) for k in range(10)])
        wait_for(lambda: sink.counters.rows == 10, "the rows")
    broker.terminate()
    broker.wait(LIMIT_S)
