"""`acqd watch`: live power from the broker."""

from __future__ import annotations

import asyncio
import sys
from typing import TYPE_CHECKING, Annotated

import typer
from rich.live import Live

from acqd.cli.options import ConfigFile, Host, Json, Port, broker_address
from acqd.cli.terminal import terminal
from acqd.cli.watched import Watched
from acqd.errors import UserError
from acqd.telemetry import topics
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.row_message import payloads_of

if TYPE_CHECKING:  # acqd run starts without it
    import aiomqtt

_RETRY_S = 1.0
_REFRESH_S = 1.0


def watch(
    config: ConfigFile = None,
    host: Host = None,
    port: Port = None,
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds.")] = None,
    count: Annotated[int | None, typer.Option(min=1, help="Stop after so many rows.")] = None,
    json: Json = False,
) -> None:
    """Show live values of every device on the broker; with --json, print every row as a JSON line.

    A broker that goes away is waited for.

    Example: acqd watch --host 192.168.1.10
    """
    import aiomqtt

    address = broker_address(config, host, port, "web")
    try:
        asyncio.run(_watch(address, duration, count, json))
    except aiomqtt.MqttError as error:
        raise UserError(f"broker {address}: {error}; is it running, and are host, port and password right?") from None


async def _watch(address: BrokerAddress, duration: float | None, count: int | None, json: bool) -> None:
    try:
        async with asyncio.timeout(duration):
            await (_rows(address, count) if json else _table(address, count))
    except TimeoutError:
        return


def _client(address: BrokerAddress) -> aiomqtt.Client:
    import aiomqtt

    return aiomqtt.Client(
        address.host, address.port, username=address.username, password=address.password,
        tls_context=address.tls_context(), timeout=5.0,
    )  # fmt: skip


async def _rows(address: BrokerAddress, count: int | None) -> None:
    """Print rows; only the first connection must succeed. Raises aiomqtt.MqttError."""
    import aiomqtt

    seen, connected = 0, False
    while True:
        try:
            async with _client(address) as client:
                for topic in (topics.ALL_POWER, topics.ALL_WINDOWS):
                    await client.subscribe(topic, qos=1)
                if connected:
                    print(f"acqd: connected to {address} again", file=sys.stderr)
                connected = True
                async for message in client.messages:
                    for payload in _payloads(str(message.topic), bytes(message.payload)):
                        sys.stdout.buffer.write(payload + b"\n")
                        seen += 1
                        if seen == count:
                            break
                    sys.stdout.flush()
                    if seen == count:
                        return
        except aiomqtt.MqttError as error:
            _end_if_cancelled()
            if not connected:
                raise
            print(f"acqd: broker {address}: {error}; trying again", file=sys.stderr)
            await asyncio.sleep(_RETRY_S)


def _end_if_cancelled() -> None:
    """Raises the CancelledError that aiomqtt has replaced: a cancelled connection may fail to disconnect."""
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError


def _payloads(topic: str, payload: bytes) -> list[bytes]:
    """Rows of a message; what is no window is shown as it came."""
    try:
        return payloads_of(topic, payload)
    except ValueError:
        return [payload]


async def _table(address: BrokerAddress, count: int | None) -> None:
    """Show summaries; only the first connection must succeed. Raises aiomqtt.MqttError."""
    watched = Watched(str(address))
    console = terminal(soft_wrap=False)
    try:
        with Live(console=console, auto_refresh=False) as live:
            refreshing = asyncio.create_task(_refresh(live, watched))
            try:
                while not await _until_lost(address, live, watched, count):
                    await asyncio.sleep(_RETRY_S)
            finally:
                refreshing.cancel()
                live.update(watched.table(), refresh=True)
    finally:
        if not console.is_terminal:
            console.print()  # in a pipe, Live leaves the last line open


async def _until_lost(address: BrokerAddress, live: Live, watched: Watched, count: int | None) -> bool:
    """Show summaries until `count` (True) or until the connection is lost (False)."""
    import aiomqtt

    try:
        async with _client(address) as client:
            for topic in (topics.ALL_SUMMARIES, topics.ALL_STATUS, topics.ALL_PREDICTIONS):
                await client.subscribe(topic, qos=1)
            watched.connected()
            async for message in client.messages:
                if watched.take(str(message.topic), bytes(message.payload)):
                    live.update(watched.table(), refresh=True)
                if watched.summaries == count:
                    return True
    except aiomqtt.MqttError as error:
        _end_if_cancelled()
        if not watched.was_connected:
            raise
        watched.lost(str(error))
    return False


async def _refresh(live: Live, watched: Watched) -> None:
    """Show how long nothing has come."""
    while True:
        live.update(watched.table(), refresh=True)
        await asyncio.sleep(_REFRESH_S)
