"""`acqd watch --duration` ends, whatever the library says to the cancellation."""

import asyncio

import aiomqtt
import pytest

from acqd.cli import watch
from acqd.telemetry.mqtt import BrokerAddress


class Slow:
    """A connection that fails to disconnect in time, as on a busy computer."""

    async def __aenter__(self):
        return self

    async def __aexit__(self, *_):
        raise aiomqtt.MqttError("Operation timed out")

    async def subscribe(self, *_, **__):
        await asyncio.sleep(60)


@pytest.mark.parametrize("json", [False, True])
def test_a_failure_to_disconnect_does_not_make_it_go_on(json, monkeypatch):
    monkeypatch.setattr(watch, "_client", lambda _: Slow())
    asyncio.run(asyncio.wait_for(watch._watch(BrokerAddress("127.0.0.1", 1), 0.05, None, json), 20))
