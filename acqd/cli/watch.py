"""`acqd watch`: live power from the broker."""

from __future__ import annotations

import asyncio
import sys
from typing import Annotated, Any

import aiomqtt
import orjson
import typer
from rich.console import Console
from rich.live import Live

from acqd.cli.options import ConfigFile, Host, Json, Port, broker_address
from acqd.cli.table import power_table
from acqd.errors import UserError
from acqd.telemetry import topics
from acqd.telemetry.mqtt import BrokerAddress


def watch(
    config: ConfigFile = None,
    host: Host = None,
    port: Port = None,
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds.")] = None,
    count: Annotated[int | None, typer.Option(min=1, help="Stop after so many rows.")] = None,
    json: Json = False,
) -> None:
    """Show live values of every device on the broker; with --json, print every row as a JSON line.

    Example: acqd watch --host 192.168.1.10
    """
    address = broker_address(config, host, port)
    try:
        asyncio.run(_watch(address, duration, count, json))
    except aiomqtt.MqttError as error:
        raise UserError(f"broker {address}: {error}; is it running, and are host, port and password right?") from None


async def _watch(address: BrokerAddress, duration: float | None, count: int | None, json: bool) -> None:
    client = aiomqtt.Client(
        address.host, address.port, username=address.username, password=address.password,
        tls_context=address.tls_context(), timeout=5.0,
    )  # fmt: skip
    try:
        async with asyncio.timeout(duration), client:
            await client.subscribe(topics.ALL_POWER if json else topics.ALL_SUMMARIES, qos=1)
            await (_rows(client, count) if json else _table(client, count))
    except TimeoutError:
        return


async def _rows(client: aiomqtt.Client, count: int | None) -> None:
    seen = 0
    async for message in client.messages:
        sys.stdout.buffer.write(bytes(message.payload) + b"\n")
        sys.stdout.flush()
        seen += 1
        if seen == count:
            return


async def _table(client: aiomqtt.Client, count: int | None) -> None:
    latest: dict[tuple[str, str], dict[str, Any]] = {}
    seen = 0
    with Live(console=Console(), auto_refresh=False) as live:
        async for message in client.messages:
            try:
                summary = orjson.loads(message.payload)
                latest[summary["device"], summary["channel"]] = summary
                live.update(power_table(latest, f"acqd watch  {summary['time']}"), refresh=True)
            except (orjson.JSONDecodeError, KeyError, TypeError, ValueError):
                continue  # not a summary of acqd: another program's message on the same topic
            seen += 1
            if seen == count:
                return
