"""Messages that wait for the broker."""

from __future__ import annotations

import asyncio

from acqd.telemetry.outbox import MemoryOutbox, Message


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
