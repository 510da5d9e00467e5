"""The embedded broker."""

from __future__ import annotations

import asyncio
from pathlib import Path

import aiomqtt
import pytest

from acqd.errors import UserError
from acqd.telemetry import broker as module
from acqd.telemetry.broker import EmbeddedBroker, check_port, free_port
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.subscriber import Subscriber, SubscriberError
from acqd.telemetry.wire import UNSUPPORTED, V5, V311, Hello
from tests.telemetry.clients import collect, connector, delivery, put, stop
from tests.waiting import finish, until


def test_embedded_broker_carries_rows_and_names_a_busy_port():
    async def scenario():
        port = free_port()
        server = EmbeddedBroker("127.0.0.1", port)
        await server.start()
        with pytest.raises(UserError, match=f"{port}.*another"):
            check_port("127.0.0.1", port)
        received, ready = [], asyncio.Event()
        viewer = asyncio.create_task(collect(port, "acqd/#", 500, received, ready))
        await ready.wait()
        outbox = delivery()
        running = asyncio.create_task(connector(BrokerAddress(port=port), outbox).run())
        put(outbox, range(500))
        await viewer
        # Before the connection all rows are backlog: in order.
        assert [payload for topic, payload, _ in received if topic.endswith("power")] == [
            str(k).encode() for k in range(len(received) - 1)
        ]
        await stop(running)
        await server.stop()

    finish(scenario())


def test_retained_messages_come_to_those_who_have_subscribed_to_them():
    async def scenario():
        port = free_port()
        server = EmbeddedBroker("127.0.0.1", port)
        await server.start()
        async with aiomqtt.Client("127.0.0.1", port) as early, aiomqtt.Client("127.0.0.1", port) as late:
            await early.publish("acqd/t/status", b"kept", qos=1, retain=True)
            await early.subscribe("acqd/#", qos=1)
            assert (await anext(aiter(early.messages))).payload == b"kept"
            async with aiomqtt.Client("127.0.0.1", port) as other:
                await other.subscribe("acqd/t/alone", qos=1)
                await late.publish("acqd/t/alone", b"the first", qos=1)
                assert (await anext(aiter(other.messages))).payload == b"the first"
                await other.subscribe("acqd/+/status", qos=1)
                assert (await anext(aiter(other.messages))).payload == b"kept"
        await server.stop()

    finish(scenario())


def in_state(port, state):
    """TCP connections of the listening side at `port` in a state of /proc/net/tcp."""
    lines = Path("/proc/net/tcp").read_text().splitlines()[1:]
    ours = [line.split() for line in lines if line.split()[1].endswith(f":{port:04X}")]
    return sum(fields[3] == state for fields in ours)


CLOSE_WAIT, ESTABLISHED = "08", "01"
MALFORMED = [
    b"\x10\x00", b"\x10\x02\x00\x04", b"\x10\x0c\x00\x04MQTX\x04\x02\x00\x3c\x00\x00", b"GET / HTTP/1.1\r\n\r\n",
    b"\x10\xff\xff\xff\x7f" + b"\x00" * 20, b"\x10\x0e\x00\x04MQTT\x04\x02\x00\x3c\x00\x02\xff\xfe", b"\x30\x02ab",
    b"\x00" * 50, b"\xff\xff\xff\xff\xff\xff", b"",
]  # fmt: skip


def test_malformed_connects_leave_no_connection_behind():
    async def scenario():
        port = free_port()
        server = EmbeddedBroker("127.0.0.1", port)
        await server.start()
        for k in range(200):
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(MALFORMED[k % len(MALFORMED)])
            writer.close()
        await until(lambda: in_state(port, CLOSE_WAIT) == 0, "all connections are closed")
        received, ready = [], asyncio.Event()
        viewer = asyncio.create_task(collect(port, "acqd/#", 1, received, ready))
        await ready.wait()  # and the broker still works
        viewer.cancel()
        await server.stop()

    finish(scenario())


def test_who_says_nothing_and_who_says_too_much_is_disconnected(monkeypatch):
    monkeypatch.setattr(module, "_CONNECT_S", 0.2)
    monkeypatch.setattr(module, "MOST_CONNECTIONS", 5)

    async def scenario():
        port = free_port()
        server = EmbeddedBroker("127.0.0.1", port)
        await server.start()
        silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(8)]
        assert [await reader.read(1) for reader, _ in silent] == [b""] * 8  # 3 at once, 5 after the time for CONNECT
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"\x10\x0d\x00\x04MQTT\x04\x02\x00\x3c\x00\x01a")
        assert await reader.readexactly(4) == b"\x20\x02\x00\x00"
        writer.write(b"\x30\x84\x80\x80\x01\x00\x01t")  # PUBLISH of 2 MB
        assert await reader.read(1) == b""
        await server.stop()

    finish(scenario())


def test_who_only_waits_makes_room_for_who_comes_when_all_places_are_taken(monkeypatch):
    monkeypatch.setattr(module, "_CONNECT_S", 0.2)
    monkeypatch.setattr(module, "MOST_CONNECTIONS", 4)
    hello = b"\x10\x0d\x00\x04MQTT\x04\x02\x00\x3c\x00\x01"

    async def scenario():
        port = free_port()
        server = EmbeddedBroker("127.0.0.1", port)
        await server.start()

        async def client(name, *packets):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(hello + name + b"".join(packets))
            assert await reader.read(4) == b"\x20\x02\x00\x00"
            return reader, writer

        viewer = await client(b"v", b"\x82\x06\x00\x01\x00\x01t\x01")
        assert await viewer[0].readexactly(5) == b"\x90\x03\x00\x01\x01"
        idle = [await client(name, b"\xc0\x00" * 3) for name in (b"a", b"b", b"c")]
        await asyncio.sleep(0.3)
        comes = await client(b"d")
        assert await idle[0][0].read(100) == b"\xd0\x00" * 3, "answers to its pings, and the end"
        comes[1].write(b"\x30\x04\x00\x01tx")
        assert (await viewer[0].readexactly(5))[4:] == b"t", "the viewer is still there"
        await server.stop()

    finish(scenario())


@pytest.mark.parametrize("piece", [1, 3, 1_000])
def test_the_kinds_of_packets_are_known_however_the_bytes_come(piece):
    for end, used in ((b"\xc0\x00", False), (b"\x82\x06\x00\x01\x00\x01t\x01", True)):
        data = b"\x10\x90\x01" + b"\x82" * 144 + b"\xc0\x00" + end
        kinds = module._Kinds()
        for k in range(0, len(data), piece):
            kinds.feed(data[k : k + piece])
        assert kinds.used is used


def test_broker_and_page_listen_on_ipv6_too():
    async def scenario():
        server = EmbeddedBroker("::1", free_port("::1"))
        await server.start()
        _, writer = await asyncio.open_connection("::1", server.port)
        writer.close()
        with pytest.raises(UserError, match="another page"):
            check_port("::1", server.port, "page")
        await server.stop()

    finish(scenario())


def test_mqtt_5_is_refused_at_once_and_3_1_1_accepted():
    async def scenario():
        port = free_port()
        server = EmbeddedBroker("127.0.0.1", port)
        await server.start()
        said = [await asyncio.to_thread(attempt, port, version) for version in (V5, V311)]
        await server.stop()
        return said

    assert asyncio.run(scenario()) == [UNSUPPORTED, "accepted"]


def attempt(port, version):
    hello = Hello(version, "t", 10, None, None, "t/will", b"", 0, 0, 1 << 16)
    subscriber = Subscriber(BrokerAddress(port=port), hello)
    try:
        subscriber.connect()
    except SubscriberError as error:
        return str(error)
    finally:
        subscriber.close()
    return "accepted"
