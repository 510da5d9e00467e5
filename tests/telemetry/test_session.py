"""One connection of the daemon to a broker."""

from __future__ import annotations

import asyncio
import socket
import struct
import threading
import time

import pytest

from acqd.telemetry.message import Message
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.session import Session, SessionError
from tests.telemetry.clients import delivery


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


def test_a_connection_that_is_reset_before_connect_is_written_is_a_failed_attempt(resetting):
    port, reset = resetting

    def opened(*_):
        reset.set()
        time.sleep(0.2)  # the reset arrives before CONNECT is written

    async def scenario():
        session = Session(BrokerAddress(port=port), None, "t", Message("t/status", b""), delivery())
        session._client.on_socket_open = opened
        with pytest.raises(SessionError):
            async with session:
                pass

    asyncio.run(scenario())
