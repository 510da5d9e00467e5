"""A connector under test and an independent subscriber (aiomqtt)."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import aiomqtt

from acqd.telemetry.connector import Connector
from acqd.telemetry.delivery import Delivery
from acqd.telemetry.spool import Spool, SpooledRow, Stream

STREAM = Stream("t", "L1", "boot")


def delivery(until="acknowledged", spool=None):
    return Delivery(Spool(None) if spool is None else spool, until, ["t"])


def put(outbox, numbers):
    for k in numbers:
        outbox.put_rows([SpooledRow(STREAM, k, str(k).encode())])


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
