"""A TCP proxy with a round-trip time, for what is far away."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

_PIECE = 1 << 16


@asynccontextmanager
async def delayed(port: int, round_trip_s: float) -> AsyncIterator[int]:
    """Forward connections to 127.0.0.1:`port`, every byte late by half a round trip; yields the proxy's port."""
    tasks: set[asyncio.Task[None]] = set()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there = await asyncio.open_connection("127.0.0.1", port)
        for source, target in ((reader, there[1]), (there[0], writer)):
            task = asyncio.create_task(_forward(source, target, round_trip_s / 2))
            tasks.add(task)
            task.add_done_callback(tasks.discard)

    server = await asyncio.start_server(serve, "127.0.0.1")
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in list(tasks):
            task.cancel()


async def _forward(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, delay_s: float) -> None:
    loop = asyncio.get_running_loop()
    with contextlib.suppress(OSError):
        while data := await reader.read(_PIECE):
            loop.call_later(delay_s, writer.write, data)
    loop.call_later(delay_s, writer.close)
