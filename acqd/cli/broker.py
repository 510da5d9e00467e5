"""`acqd broker`: the embedded broker without the daemon."""

from __future__ import annotations

import asyncio
import signal
from typing import Annotated

import orjson
import typer

from acqd.cli.options import Json, bare
from acqd.daemon.notify import notify
from acqd.plc.realtime import die_with_parent

_ALIVE_S = 5.0


def broker(
    host: Annotated[str, typer.Option(callback=bare, help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535)] = 1883,
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds.")] = None,
    embedded: Annotated[int | None, typer.Option("--embedded", hidden=True, help="Process id of its daemon.")] = None,
    json: Json = False,
) -> None:
    """Run the embedded MQTT broker (3.1.1, no passwords; a plant runs mosquitto).

    Example: acqd broker --port 1884
    """
    if embedded:
        die_with_parent(embedded)
    asyncio.run(_serve(host, port, duration, json))


async def _serve(host: str, port: int, duration: float | None, json: bool) -> None:
    # Here: every command imports this module, and amqtt takes a fifth of their start.
    from acqd.telemetry.broker import EmbeddedBroker

    server = EmbeddedBroker(host, port)
    await server.start()
    print(orjson.dumps({"host": host, "port": port}).decode() if json else f"listening on {host}:{port}", flush=True)
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    notify("READY=1")
    end = None if duration is None else loop.time() + duration
    while not stop.is_set() and (end is None or loop.time() < end):
        notify("WATCHDOG=1")
        left = _ALIVE_S if end is None else min(_ALIVE_S, end - loop.time())
        try:
            await asyncio.wait_for(stop.wait(), max(left, 0))
        except TimeoutError:
            continue
    notify("STOPPING=1")
    await server.stop()
