"""`acqd alarms`: tells people what is wrong."""

from __future__ import annotations

import asyncio
import getpass
import socket
import time
from typing import TYPE_CHECKING, Annotated, Any

import orjson
import typer

from acqd.cli.options import ConfigFile, Host, Json, Port, broker_address, configured
from acqd.errors import UserError, without_number
from acqd.integrations.alarms.section import AlarmsSection
from acqd.telemetry.mqtt import BrokerAddress

if TYPE_CHECKING:  # acqd run starts without it
    import aiomqtt

    from acqd.daemon.config import Config
    from acqd.energy.budget import Standing
    from acqd.integrations.regularly import Regularly

app = typer.Typer(invoke_without_command=True)
_LIST_S = 2.0
_LONGEST_NAME = 100
_BUDGETS_S = 300.0
"""Time between two looks at the budgets."""
_NOBODY = "[alarms] of acqd.toml names nobody to tell: set webhooks or mail_to there"


@app.callback()
def alarms(context: typer.Context, config: ConfigFile = None, host: Host = None, port: Port = None) -> None:
    """Tell the webhooks and mailboxes of section alarms when a residual changes or a daemon is in trouble.

    Example: acqd alarms --config /etc/acqd/acqd.toml
    """
    if context.invoked_subcommand is not None:
        if any((config, host, port)):
            raise UserError(f"put the options after the subcommand: acqd alarms {context.invoked_subcommand} ...")
        return
    from acqd.integrations.alarms.service import Alarms
    from acqd.integrations.service import serve

    settings = configured(config, host, port, "bridge")
    if not settings.table(AlarmsSection).webhooks and not settings.table(AlarmsSection).mail_to:
        raise UserError(_NOBODY)
    with Alarms(settings.table(AlarmsSection), _watched_budgets(settings)) as service:
        serve(settings.mqtt.address(), service.watch, f"acqd-alarms-{socket.gethostname()}")


def _watched_budgets(settings: Config) -> Regularly[list[Standing]] | None:
    """None without budgets. Raises UserError."""
    if not settings.table(AlarmsSection).budgets:
        return None
    from acqd.energy.budget import Budgets
    from acqd.energy.rules import rules_of
    from acqd.integrations.regularly import Regularly

    budgets = Budgets(settings.table(AlarmsSection).budgets, rules_of(settings.energy))
    return Regularly(
        settings.sink.database, lambda engine: budgets.standings(engine, time.time()), _BUDGETS_S,
        lambda why: budgets.unknown(why, time.time()),
    )  # fmt: skip


@app.command("budgets")
def budgets_command(config: ConfigFile = None, json: Json = False) -> None:
    """Show where every budget of section alarms stands now, with the forecast and what it rests on.

    Example: acqd alarms budgets --config /etc/acqd/acqd.toml
    """
    from acqd.energy.budget import Budgets
    from acqd.energy.rules import rules_of
    from acqd.storage.database import read_database

    settings = configured(config)
    if not settings.table(AlarmsSection).budgets:
        raise UserError("[alarms] has no budgets; docs/energy.md shows how to set some")
    budgets = Budgets(settings.table(AlarmsSection).budgets, rules_of(settings.energy))
    standings = budgets.standings(read_database(settings.sink.database), time.time())
    if json:
        print(orjson.dumps([each.as_json() for each in standings]).decode())
    else:
        for each in standings:
            print(f"{each.state}: {each.text}")


@app.command("list")
def list_command(config: ConfigFile = None, host: Host = None, port: Port = None, json: Json = False) -> None:
    """Show the active alarms, as the running `acqd alarms` publishes them; exit 1 when there are any.

    Example: acqd alarms list --config /etc/acqd/acqd.toml
    """
    active = asyncio.run(_active(broker_address(config, host, port, "web")))
    if json:
        print(orjson.dumps(active).decode())
    else:
        for alarm in active:
            by = f"  acknowledged by {alarm['acknowledged_by']}" if alarm["acknowledged_by"] else ""
            print(f"{alarm['since']}  {alarm['key']}  {alarm['text']}{by}")
        if not active:
            print("no alarms")
    if active:
        raise typer.Exit(1)


@app.command("history")
def history_command(
    most: Annotated[int, typer.Option("--limit", "--most", min=1, help="So many alarms, the newest first.")] = 50,
    config: ConfigFile = None,
    json: Json = False,
) -> None:
    """Show past and active alarms: since when, until when, who has acknowledged them.

    Reads the file beside the state of section alarms, on the computer where `acqd alarms` runs.

    Example: acqd alarms history --config /etc/acqd/acqd.toml
    """
    from acqd.cli.folded_table import Table
    from acqd.cli.terminal import terminal
    from acqd.integrations.alarms.history import history_file, read_history

    found = read_history(history_file(configured(config).table(AlarmsSection).state))[:most]
    if json:
        print(orjson.dumps(found).decode())
        return
    table = Table("since (UTC)", "until (UTC)", "key", "what", "acknowledged by")
    for alarm in found:
        until = alarm["resolved"][:16].replace("T", " ") or "active"
        since = alarm["since"][:16].replace("T", " ")
        table.add_row(since, until, alarm["key"], alarm["text"], alarm["acknowledged_by"])
    terminal(tables=True).print(table)


@app.command("acknowledge")
def acknowledge_command(
    key: Annotated[str, typer.Argument(help="DEVICE/KIND, as `acqd alarms list` shows it.")],
    by: Annotated[str, typer.Option(help="Who takes care of it (default: the user of this computer).")] = "",
    config: ConfigFile = None,
    host: Host = None,
    port: Port = None,
    json: Json = False,
) -> None:
    """Say that somebody takes care of an alarm: there are no more reminders of it.

    Example: acqd alarms acknowledge cell-1/residual --by Ada
    """
    if not by.isprintable() or len(by) > _LONGEST_NAME or (by and not by.strip()):
        raise UserError(f"--by {by!r:.60}: expected a name of at most {_LONGEST_NAME} letters in one line")
    address = broker_address(config, host, port, "operator")
    if key not in {alarm["key"] for alarm in asyncio.run(_active(address))}:
        raise UserError(f"{key!r} is no active alarm; acqd alarms list shows the keys")
    name = by or getpass.getuser()
    asyncio.run(_send(address, orjson.dumps({"key": key, "by": name})))
    print(orjson.dumps({"key": key, "by": name}).decode() if json else f"{key} acknowledged by {name}")


@app.command("test")
def test_command(config: ConfigFile = None, json: Json = False) -> None:
    """Send a test notification to every target, once; exit 2 when one does not take it.

    Example: acqd alarms test --config /etc/acqd/acqd.toml
    """
    from acqd.integrations.alarms.targets import RefusedError, targets_of

    section = configured(config).table(AlarmsSection)
    targets = targets_of(section)
    content = {"event": "test", "key": "test/test", "text": f"[acqd] test from {socket.gethostname()}", "details": {}}
    for target in targets:
        try:
            target.send(content)
        except (RefusedError, OSError, ValueError) as error:
            reason = getattr(error, "reason", None) or error
            raise UserError(f"{target.name}: {reason}; check [alarms] in the configuration") from None
    if not targets:
        raise UserError(_NOBODY)
    print(orjson.dumps({"targets": len(targets)}).decode() if json else f"{len(targets)} targets have taken the test")


def _client(address: BrokerAddress) -> aiomqtt.Client:
    import aiomqtt

    return aiomqtt.Client(
        address.host, address.port, username=address.username, password=address.password,
        tls_context=address.tls_context(), timeout=5.0,
    )  # fmt: skip


async def _active(address: BrokerAddress) -> list[dict[str, Any]]:
    """The retained list. Raises UserError without a list: `acqd alarms` has never run on this broker."""
    import aiomqtt

    from acqd.integrations.alarms.watch import ACTIVE

    try:
        async with _client(address) as client:
            await client.subscribe(ACTIVE, qos=1)
            async with asyncio.timeout(_LIST_S):
                async for message in client.messages:
                    if str(message.topic) == ACTIVE:
                        found: list[dict[str, Any]] = orjson.loads(bytes(message.payload))
                        return found
            raise TimeoutError
    except TimeoutError:
        raise UserError(f"no list of alarms at {address}: start acqd alarms first") from None
    except aiomqtt.MqttError as error:
        raise UserError(f"broker {address}: {without_number(error)}; check host and port") from None


async def _send(address: BrokerAddress, payload: bytes) -> None:
    import aiomqtt

    from acqd.integrations.alarms.watch import ACKNOWLEDGE

    try:
        async with _client(address) as client:
            await client.publish(ACKNOWLEDGE, payload, qos=1)
    except aiomqtt.MqttError as error:
        raise UserError(f"broker {address}: {without_number(error)}; check host and port") from None
