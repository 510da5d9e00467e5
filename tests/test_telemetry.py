"""Rows, summaries, the outbox, and MQTT_CONNECTOR against a real mosquitto."""

from __future__ import annotations

import asyncio
import json
import subprocess
from contextlib import suppress
from datetime import UTC, datetime

import aiomqtt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.errors import UserError
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.telemetry.broker import EmbeddedBroker, check_port, free_port
from acqd.telemetry.connector import Connector
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.outbox import MemoryOutbox, Message
from acqd.telemetry.row import CHANNELS, PowerRow, parse_row, rows_of
from acqd.telemetry.summary import Summariser
from acqd.telemetry.topics import valid_device
from acqd.timestamps import filetime, rfc3339

from .conftest import make_mains

FIELDS = [
    "device",
    "channel",
    "boot",
    "seq",
    "time",
    "filetime",
    "Vrms",
    "Irms",
    "P",
    "S",
    "PF",
    "f",
    "W",
    "flags",
    "schema",
]


def some_rows(phases=3, seconds=1.0, utc_ns=1_626_164_130_123_456_789, **options):
    mains = make_mains(50.0, phases=phases, seconds=seconds, **options)
    meter = Meter(StreamFormat(20_000.0, mains.scale))
    batch = meter.feed(SampleBlock(mains.codes, 0, utc_ns))
    return meter, batch, list(rows_of(batch, "cell1", "b00t"))


def test_a_row_has_exactly_the_fixed_fields_in_order():
    _, _, rows = some_rows()
    plain = json.loads(rows[0].to_json())
    assert list(plain) == FIELDS
    assert plain["device"] == "cell1" and plain["schema"] == 1 and plain["flags"] == ["start"]
    assert plain["time"] == "2021-07-13T08:15:30.123456Z"
    assert plain["filetime"] == 1_626_164_130_123_456_789 // 100 + 116_444_736_000_000_000


def test_channels_are_the_phases_and_with_several_the_total():
    _, _batch, rows = some_rows()
    assert [row.channel for row in rows[:5]] == ["L1", "L2", "L3", "total", "L1"]
    total = rows[3]
    assert pytest.approx(sum(row.P for row in rows[:3])) == total.P
    assert pytest.approx(sum(row.S for row in rows[:3])) == total.S
    assert pytest.approx(sum(row.W for row in rows[:3])) == total.W
    assert pytest.approx(total.P / total.S) == total.PF
    _, _, single = some_rows(phases=1)
    assert {row.channel for row in single} == {"L1"}


def test_unknown_quantities_are_null_never_nan():
    mains = make_mains(50.0, seconds=0.4, phases=1)
    mains.codes[:] = 0
    batch = Meter(StreamFormat(20_000.0, mains.scale)).feed(SampleBlock(mains.codes, 0, 0))
    for row in rows_of(batch, "d", "b"):
        plain = json.loads(row.to_json())
        assert plain["f"] is None and plain["PF"] is None and plain["Vrms"] == 0.0
        assert b"NaN" not in row.to_json() and "no_mains" in plain["flags"]


@given(st.integers(0, 4 * 10**18))
def test_both_time_stamps_tell_the_same_time(utc_ns):
    stamp = datetime.fromisoformat(rfc3339(utc_ns))
    micros = (stamp - datetime(1970, 1, 1, tzinfo=UTC)) // (datetime.resolution)
    assert micros == utc_ns // 1000
    assert (filetime(utc_ns) - 116_444_736_000_000_000) // 10 == micros


_value = st.none() | st.floats(-1e9, 1e9)


@given(
    seq=st.integers(0, 2**62), values=st.lists(_value, min_size=7, max_size=7), channel=st.sampled_from(CHANNELS),
    flags=st.lists(st.sampled_from(["gap", "late", "overrange"]), unique=True),
)  # fmt: skip
def test_rows_survive_the_wire(seq, values, channel, flags):
    row = PowerRow("d", channel, "b", seq, "2021-07-13T08:15:30.123456Z", 5, *values, flags)
    assert parse_row(row.to_json()) == row


@pytest.mark.parametrize(
    ("change", "complaint"),
    [({"P": "12"}, "P"), ({"seq": -1}, "seq"), ({"seq": 1.5}, "seq"), ({"channel": "L4"}, "channel"),
     ({"time": "yesterday"}, "time"), ({"time": "2021-13-45T00:00:00Z"}, "RFC 3339"), ({"device": ""}, "device"),
     ({"flags": None}, "flags"), ({"schema": 2}, "schema"), ({"boot": None}, "boot"),
     ({"filetime": 2**70}, "filetime|int")],
)  # fmt: skip
def test_malformed_rows_are_refused_with_the_field(change, complaint):
    _, _, rows = some_rows(phases=1)
    plain = json.loads(rows[0].to_json()) | change
    with pytest.raises(ValueError, match=complaint):
        parse_row(json.dumps(plain).encode())


def test_deep_nesting_and_absurd_numbers_are_refused():
    _, _, rows = some_rows(phases=1)
    text = rows[0].to_json()
    for bad in (text[:-1] + b',"x":' + b"[" * 5_000 + b"]" * 5_000 + b"}", text.replace(b'"S":', b'"S":1e200,"SS":')):
        with pytest.raises(ValueError):
            parse_row(bad)


@given(st.binary(max_size=60))
def test_any_bytes_are_refused_without_a_crash(payload):
    with pytest.raises(ValueError):
        parse_row(payload)


def test_device_names_that_would_break_topics_are_refused():
    assert valid_device("cell-1.a_B")
    assert not any(valid_device(name) for name in ("", "a/b", "a+", "#", "a b", "x" * 65))


def test_summaries_come_once_a_second_and_add_up():
    _, batch, rows = some_rows(seconds=3.2, utc_ns=10**18)
    summariser = Summariser()
    summaries = summariser.add(batch, rows)
    assert len(summaries) == 3 * 4
    first = [row for row in rows if row.channel == "L2"][:25]
    second = next(s for s in summaries if s["channel"] == "L2")
    assert second["rows"] == 25 and second["time"] == "2001-09-09T01:46:40.000000Z"
    assert second["P"] == pytest.approx(np.mean([row.P for row in first]))
    assert second["Vrms"] == pytest.approx(np.sqrt(np.mean([row.Vrms**2 for row in first])))
    assert second["W"] == first[-1].W == pytest.approx(second["W_import"] - second["W_export"])


def test_a_full_outbox_drops_the_oldest_and_counts():
    async def scenario():
        box = MemoryOutbox(3)
        messages = [Message("t", bytes([k])) for k in range(5)]
        for message in messages[:3]:
            box.put(message)
        taken = await box.peek(2)
        for message in messages[3:]:
            box.put(message)
        assert box.dropped == 2 and len(box) == 3
        box.confirm(taken)  # both were dropped meanwhile: nothing else may go
        assert await box.peek(9) == messages[2:]

    asyncio.run(scenario())


def connector(address, outbox):
    return Connector(
        address, outbox, client_id="acqd-t", status_topic="acqd/t/status", greeting=lambda: b'{"state":"online"}'
    )


async def collect(port, topic, count, into, ready=None, **options):
    async with aiomqtt.Client("127.0.0.1", port, **options) as client:
        await client.subscribe(topic, qos=1)
        if ready:
            ready.set()
        async for message in client.messages:
            into.append((str(message.topic), bytes(message.payload), message.retain))
            if len(into) >= count:
                return


async def stop(task):
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task


def test_connector_starts_without_a_broker_and_loses_nothing_when_it_goes_away(mosquitto):
    mosquitto.stop()

    async def scenario():
        outbox = MemoryOutbox(10_000)
        running = asyncio.create_task(connector(BrokerAddress(port=mosquitto.port), outbox).run())
        sent = 0

        def send(count):
            nonlocal sent
            for _ in range(count):
                outbox.put(Message("acqd/t/L1/power", str(sent).encode()))
                sent += 1

        send(100)
        await asyncio.sleep(0.3)
        assert len(outbox) == 100
        await asyncio.to_thread(mosquitto.start)
        received, ready = [], asyncio.Event()
        # A persistent subscriber session: the broker keeps for it what it had accepted.
        options = {"identifier": "viewer", "clean_session": False}
        viewer = asyncio.create_task(collect(mosquitto.port, "acqd/t/+/power", 10**9, received, ready, **options))
        await ready.wait()
        send(200)
        while len(outbox):
            await asyncio.sleep(0.01)
        await asyncio.to_thread(mosquitto.stop)
        await asyncio.gather(viewer, return_exceptions=True)
        send(200)
        await asyncio.sleep(0.3)
        await asyncio.to_thread(mosquitto.start)
        viewer = asyncio.create_task(collect(mosquitto.port, "acqd/t/+/power", 10**9, received, **options))
        while len(outbox):
            await asyncio.sleep(0.01)
        wanted = {str(k).encode() for k in range(100, 500)}
        while wanted - {payload for _, payload, _ in received}:
            await asyncio.sleep(0.02)
        assert outbox.dropped == 0
        await stop(viewer)
        await stop(running)

    asyncio.run(asyncio.wait_for(scenario(), 60))


def test_status_is_retained_and_the_last_will_says_offline(mosquitto):
    async def scenario():
        outbox = MemoryOutbox(10)
        address = BrokerAddress(port=mosquitto.port)
        speaker = connector(address, outbox)
        running = asyncio.create_task(speaker.run())
        while speaker.state != "connected":
            await asyncio.sleep(0.01)
        seen = []
        await collect(mosquitto.port, "acqd/t/status", 1, seen)
        assert json.loads(seen[0][1]) == {"state": "online"}
        await stop(running)
        seen.clear()
        await collect(mosquitto.port, "acqd/t/status", 1, seen)
        assert seen == [("acqd/t/status", b"offline", True)]

    asyncio.run(asyncio.wait_for(scenario(), 30))


def test_a_refused_password_is_a_user_error(mosquitto):
    mosquitto.stop()
    passwords = mosquitto.folder / "passwords"
    passwords.touch(mode=0o600)
    subprocess.run(["mosquitto_passwd", "-b", passwords, "acqd", "right"], check=True)
    mosquitto.extra = f"allow_anonymous false\npassword_file {passwords}\n"
    mosquitto.start()

    async def attempt(password):
        address = BrokerAddress(port=mosquitto.port, username="acqd", password=password)
        speaker = connector(address, MemoryOutbox(10))
        running = asyncio.create_task(speaker.run())
        while speaker.state != "connected" and not running.done():
            await asyncio.sleep(0.01)
        if running.done():
            running.result()
        await stop(running)

    asyncio.run(asyncio.wait_for(attempt("right"), 30))
    with pytest.raises(UserError, match="refused the connection"):
        asyncio.run(asyncio.wait_for(attempt("wrong"), 30))


def test_tls_with_a_private_ca(mosquitto):
    folder = mosquitto.folder
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-keyout", "key.pem", "-out",
         "cert.pem", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"],
        cwd=folder, check=True, capture_output=True,
    )  # fmt: skip
    mosquitto.stop()
    mosquitto.extra = f"allow_anonymous true\ncertfile {folder}/cert.pem\nkeyfile {folder}/key.pem\n"
    mosquitto.start()

    async def scenario():
        outbox = MemoryOutbox(10)
        outbox.put(Message("acqd/t/L1/power", b"x"))
        address = BrokerAddress(port=mosquitto.port, tls=True, ca_file=folder / "cert.pem")
        running = asyncio.create_task(connector(address, outbox).run())
        while len(outbox):
            await asyncio.sleep(0.01)
        await stop(running)

    asyncio.run(asyncio.wait_for(scenario(), 30))
    with pytest.raises(UserError, match="ca_file"):
        BrokerAddress(tls=True, ca_file=folder / "none.pem").tls_context()


def test_embedded_broker_carries_rows_and_names_a_busy_port():
    async def scenario():
        port = free_port()
        server = EmbeddedBroker("127.0.0.1", port)
        await server.start()
        with pytest.raises(UserError, match=f"{port}.*another"):
            check_port("127.0.0.1", port)
        received, ready = [], asyncio.Event()
        viewer = asyncio.create_task(collect(port, "acqd/#", 2_000, received, ready))
        await ready.wait()
        outbox = MemoryOutbox(5_000)
        running = asyncio.create_task(connector(BrokerAddress(port=port), outbox).run())
        for k in range(2_000):
            outbox.put(Message("acqd/t/L1/power", str(k).encode()))
        await viewer
        assert [payload for topic, payload, _ in received if topic.endswith("power")] == [
            str(k).encode() for k in range(len(received) - 1)
        ]
        await stop(running)
        await server.stop()

    asyncio.run(asyncio.wait_for(scenario(), 60))
