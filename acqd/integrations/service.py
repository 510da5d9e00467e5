"""A bridge as a service: runs until SIGTERM or SIGINT, and says to systemd when it is ready."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Awaitable, Callable

from acqd.daemon.notify import notify
from acqd.integrations.bridge import Bridge, Relay
from acqd.telemetry.mqtt import BrokerAddress

_BEAT_S = 10.0


def serve(address: BrokerAddress, bridge: Bridge, name: str, for_s: float | None = None, qos: int = 1) -> int:
    """Relay until the process is asked to stop, or for `for_s` seconds without retained ones; the messages sent.

    Raises UserError.
    """
    relay = Relay(address, bridge, name, qos)

    async def run(stop: asyncio.Event) -> None:
        await relay.run(stop, for_s)

    asyncio.run(until_stopped(run))
    return relay.sent


async def until_stopped(work: Callable[[asyncio.Event], Awaitable[None]]) -> None:
    """Run `work` with an event that SIGTERM and SIGINT set."""
    stop = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, stop.set)
    notify("READY=1")
    alive = asyncio.create_task(_beat())
    try:
        await work(stop)
    finally:
        alive.cancel()
        notify("STOPPING=1")


async def _beat() -> None:
    """Show systemd's watchdog that the event loop turns."""
    while True:
        notify("WATCHDOG=1")
        await asyncio.sleep(_BEAT_S)
