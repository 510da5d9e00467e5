"""The embedded broker."""

from __future__ import annotations

import asyncio

import pytest

from acqd.errors import UserError
from acqd.telemetry.broker import EmbeddedBroker, check_port, free_port
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.outbox import MemoryOutbox, Message
from tests.telemetry.clients import collect, connector, stop
from tests.waiting import finish


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

    finish(scenario())
