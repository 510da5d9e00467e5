"""One connection of the daemon to a broker."""

from __future__ import annotations

import asyncio
import socket
import struct
import threading
import time

import pytest

from acqd.telemetry.message import Message
from acqd.telemetry.mqtt import BrokerAddress, dial
from acqd.telemetry.patience import Patience
from acqd.telemetry.session import Session, SessionError
from tests.telemetry.clients import delivery
from tests.waiting import until


@pytest.fixture
def resetting():
    """A port, and an event that resets the first connection to it, as a proxy does whose broker is away."""
    server, reset = socket.create_server(("127.0.0.1", 0)), threading.Event()

    def serve():
        client, _ = server.accept()
        reset.wait(10)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.close()

    thread = threading.Thread(target=serve)
    thread.start()
    yield server.getsockname()[1], reset
    thread.join()
    server.close()


def test_a_connection_that_is_reset_before_connect_is_written_is_a_failed_attempt(resetting, monkeypatch):
    port, reset = resetting

    def opened(*arguments):
        sock = dial(*arguments)
        reset.set()
        time.sleep(0.2)  # the reset arrives before CONNECT is written
        return sock

    monkeypatch.setattr("acqd.telemetry.loop_socket.dial", opened)

    async def scenario():
        session = Session(BrokerAddress(port=port), "t", Message("t/status", b""), delivery())
        with pytest.raises(SessionError):
            async with session:
                pass

    asyncio.run(scenario())


class _Inbox:
    """What a session tells its outbox."""

    def __init__(self):
        self.settled, self.heard = [], []

    def acknowledged(self, message):
        self.settled.append(message.tag)

    def received(self, topic, payload, *, retained):
        self.heard.append((topic, payload, retained))


def scripted(*steps):
    """A broker that answers as it is told: (first byte of the packet to wait for, its answer)."""
    server = socket.create_server(("127.0.0.1", 0))

    def serve():
        client, _ = server.accept()
        data = b""
        for expected, answer in steps:
            while expected not in data:
                data += client.recv(4096)
            data = data.partition(expected)[2]
            for byte in answer:  # one at a time: packets come in any pieces
                client.sendall(bytes([byte]))
        server.close()
        while client.recv(4096):
            pass
        client.close()

    threading.Thread(target=serve, daemon=True).start()
    return server.getsockname()[1]


def test_packets_that_arrive_byte_by_byte_are_understood():
    message = b"\x33\x0b\x00\x03t/r\x00\x07hell"  # PUBLISH, QoS 1, retained, packet 7
    port = scripted((b"MQTT", b"\x20\x02\0\0"), (b"one", b"\x40\x02\0\x01" + message), (b"\x40\x02\0\x07", b""))
    inbox = _Inbox()

    async def scenario():
        async with Session(BrokerAddress(port=port), "t", Message("t/status", b""), inbox) as session:
            session.send(Message("t/x", b"one", tag="first"), Message("t/x", b"two", tag="second"))
            await until(lambda: inbox.heard, "the message has come")
            assert len(session.window) == 1
            session.check()

    asyncio.run(scenario())
    assert inbox.settled == ["first"] and inbox.heard == [("t/r", b"hell", True)]


def test_one_acknowledgement_wakes_nobody_where_they_are_gathered_and_a_message_does():
    """It is read when somebody asks for room; what a sink sends is longer, and read at once."""
    message = b"\x33\x47\x00\x03t/r\x00\x07" + b"x" * 64
    port = scripted((b"MQTT", b"\x20\x02\0\0"), (b"one", b"\x40\x02\0\x01"), (b"two", message))
    inbox = _Inbox()

    async def scenario():
        async with Session(BrokerAddress(port=port), "t", Message("t/status", b""), inbox) as session:
            session.gather()
            session.send(Message("t/x", b"one", tag="first"))
            await asyncio.sleep(0.1)
            assert len(session.window) == 1
            assert session.room().messages and not len(session.window)
            session.send(Message("t/x", b"two", tag="second"))
            await until(lambda: inbox.heard, "the message has come")

    asyncio.run(scenario())
    assert inbox.settled == ["first"]


@pytest.mark.parametrize("answer", [b"\xff\xff\xff\xff\xff", b""])
def test_a_broker_that_speaks_no_mqtt_or_nothing_is_left(answer, monkeypatch):
    monkeypatch.setattr("acqd.telemetry.session._CONNECT_S", 0.5)
    port = scripted((b"MQTT", answer))

    async def scenario():
        with pytest.raises(SessionError, match=r"malformed|no answer to CONNECT"):
            async with Session(BrokerAddress(port=port), "t", Message("t/status", b""), _Inbox()):
                pass

    asyncio.run(scenario())


def test_more_than_the_socket_takes_is_sent_when_it_takes_more():
    """The other side reads nothing until everything is handed over."""
    count, payload, reading, got = 200, b"\xee" * 50_000, threading.Event(), []
    server = socket.create_server(("127.0.0.1", 0))

    def serve():
        client, _ = server.accept()
        client.recv(4096)
        client.sendall(b"\x20\x02\0\0")
        reading.wait(10)
        total = 0
        while total < count * len(payload) and (data := client.recv(1 << 20)):
            total += data.count(b"\xee")
        got.append(total)
        client.sendall(b"".join(b"\x40\x02" + struct.pack("!H", k + 1) for k in range(count)))
        client.recv(4096)
        client.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    inbox = _Inbox()

    async def scenario():
        address = BrokerAddress(port=server.getsockname()[1])
        async with Session(address, "t", Message("t/status", b""), inbox) as session:
            for k in range(count):
                session.send(Message("t", payload, tag=k))
            reading.set()
            await until(lambda: len(inbox.settled) == count, "all are acknowledged")

    asyncio.run(scenario())
    thread.join(10)
    server.close()
    assert got == [count * len(payload)] and inbox.settled == list(range(count))


def test_acknowledgements_that_take_longer_are_waited_for_longer(monkeypatch):
    monkeypatch.setattr("acqd.telemetry.patience.LEAST_S", 0.2)
    slow, patience = threading.Event(), Patience()
    server = socket.create_server(("127.0.0.1", 0))

    def serve():
        client, _ = server.accept()
        client.recv(4096)
        client.sendall(b"\x20\x02\0\0")
        client.recv(4096)
        slow.wait(10)
        client.sendall(b"\x40\x02\0\x01")
        while client.recv(4096):
            pass
        client.close()

    threading.Thread(target=serve, daemon=True).start()

    async def scenario():
        address = BrokerAddress(port=server.getsockname()[1])
        async with Session(address, "t", Message("t/status", b""), _Inbox(), patience=patience) as session:
            session.send(Message("t/x", b"one", tag="first"))
            await asyncio.sleep(0.3)
            session.check()  # a doubt
            slow.set()
            await until(lambda: session.window.acknowledged, "the acknowledgement has come")
            session.check()
            assert patience.s >= 0.6
            session.send(Message("t/x", b"two", tag="second"))
            await asyncio.sleep(patience.s + 0.05)
            session.check()
            with pytest.raises(SessionError, match="no acknowledgement"):
                session.check()

    asyncio.run(scenario())
    assert patience.s >= 1.2


def test_patience_has_its_limits():
    patience = Patience()
    assert patience.s == 5.0
    patience.answered(7.0)
    assert patience.s == 14.0
    for _ in range(9):
        patience.missed()
    assert patience.s == 60.0
    patience.answered(0.01)
    assert patience.s == 5.0
