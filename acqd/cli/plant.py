"""`acqd plant`: all devices on a page, a month to print, what is installed."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.atomic import require_page
from acqd.cli.folded_table import Table
from acqd.cli.options import ConfigFile, Json, configured
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.errors import UserError

if TYPE_CHECKING:
    from acqd.daemon.config import Config
    from acqd.plant.findings import Row
    from acqd.plant.heard import Heard

app = typer.Typer(no_args_is_help=True, help="All devices on a page, a month to print, what is installed.")
Database = Annotated[str | None, typer.Option(help="SQLite file or URL (default: the configuration's).")]
Tariff = Annotated[Path | None, typer.Option(help="TOML file with prices (default: the configuration's).")]
FleetFolder = Annotated[
    Path | None, typer.Option("--fleet", help="Results of acqd fleet (plant.fleet): causes, links to reports.")
]
NoBroker = Annotated[bool, typer.Option("--no-broker", help="Do not ask the broker: no states, no alarms.")]


@app.command("page")
def page_command(
    out: Annotated[Path, typer.Option(help="HTML file.")] = Path("plant.html"),
    fleet: FleetFolder = None,
    config: ConfigFile = None,
    database: Database = None,
    tariff: Tariff = None,
    no_broker: NoBroker = False,
    json: Json = False,
) -> None:
    """Every device with state, alarm, cause, kWh and EUR a day, trend, and a link to its closing report.

    Example: acqd plant page --fleet plant.fleet --out plant.html
    """
    from acqd.energy.rules import rules_of
    from acqd.extras import require
    from acqd.plant.device_row import SEVERITIES
    from acqd.plant.page import plant_page
    from acqd.plant.plant import read_plant
    from acqd.report.chain import REPORT, connect
    from acqd.report.digits import counted
    from acqd.storage.database import read_database

    require("acqd plant", ("jinja2",), "data")
    settings = _settings(config, tariff)
    require_page(out)
    told = _found(fleet)
    heard = None if no_broker else _listen(settings, "; --no-broker leaves states and alarms out")
    with progress(terminal(stderr=True)) as show:
        engine = read_database(database or settings.sink.database)
        plant = read_plant(engine, rules_of(settings.energy), time.time(), heard, told, show)
    plant_page(plant, out).write(out)
    connect(out, [fleet / REPORT] if fleet else [])
    if json:
        devices = [row.as_json() for row in plant.rows]
        about = {"devices": devices, "other_alarms": plant.loose, "trouble": plant.trouble or None}
        print(orjson.dumps({"page": str(out), **about}).decode())
    else:
        others = f", {counted(len(plant.loose), 'alarm')} of no device here" if plant.loose else ""
        counts = Counter(row.severity for row in plant.rows)
        health = ", ".join(f"{counts[each]} {each}" for each in SEVERITIES if counts[each])
        print(f"{counted(len(plant.rows), 'device')} ({health}){others}: {out}")
        _note(plant.trouble)


@app.command("month")
def month_command(
    out: Annotated[Path | None, typer.Option(help="HTML file (default: plant-MONTH.html).")] = None,
    month: Annotated[str | None, typer.Option(help="Month of local time, 2026-10 (default: the last one).")] = None,
    fleet: FleetFolder = None,
    config: ConfigFile = None,
    database: Database = None,
    tariff: Tariff = None,
    json: Json = False,
) -> None:
    """A month to print: energy and cost of every device, against the month before, peaks, standby, gaps, changes.

    Example: acqd plant month --month 2026-10 --fleet plant.fleet
    """
    from acqd.energy.page import euros
    from acqd.energy.rules import rules_of
    from acqd.extras import require
    from acqd.plant.month import month_name, month_page, month_range, read_month
    from acqd.report.chain import REPORT, connect
    from acqd.report.digits import counted
    from acqd.storage.database import read_database

    require("acqd plant", ("jinja2",), "data")
    settings = _settings(config, tariff)
    rules = rules_of(settings.energy)
    chosen, earlier = month_range(month, time.time(), rules.zone)
    path = out or Path(f"plant-{month_name(chosen, rules.zone)}.html")
    require_page(path)
    told = _found(fleet)
    with progress(terminal(stderr=True)) as show:
        engine = read_database(database or settings.sink.database)
        found = read_month(engine, rules, chosen, earlier, told, show)
    month_page(found, path).write(path)
    connect(path, [fleet / REPORT] if fleet else [])
    total = found.total
    if json:
        about = {
            "month": found.name, "kWh": total.kWh, "EUR": None if total.cost is None else float(total.cost),
            "unpriced_kWh": total.unpriced_nWh / 1e12, "devices": len(found.accounts), "without_rows": found.gone,
            "trouble": found.trouble or None,
        }  # fmt: skip
        print(orjson.dumps({"page": str(path), **about}).decode())
    else:
        price = "" if total.cost is None else f", {euros(total)}"
        print(f"{found.name}: {counted(len(found.accounts), 'device')}, {total.kWh or 0.0:.3f} kWh{price}: {path}")
        _note(found.trouble)


@app.command("inventory")
def inventory_command(config: ConfigFile = None, json: Json = False) -> None:
    """List daemons and sinks with host, version, devices and source, as they have announced themselves on the broker.

    Exit 1 when one is offline or runs an older version than another.

    Example: acqd plant inventory --config /etc/acqd/acqd.toml
    """
    from acqd.plant.inventory import HEADER, cells, inventory

    found = inventory(_listen(_settings(config, None)))
    if not found:
        raise UserError("nobody has announced itself on this broker; is it the right one?")
    if json:
        print(orjson.dumps([one.as_json() for one in found]).decode())
    else:
        table = Table(*HEADER)
        for one in found:
            table.add_row(*cells(one))
        terminal(tables=True).print(table)
        online = sum(one.online for one in found)
        versions = sorted({one.version for one in found if one.version})
        print(f"{len(found)} processes, {online} online, versions: {', '.join(versions) or 'unknown'}")
    if any(not one.online or any(remark.startswith("older than") for remark in one.remarks) for one in found):
        raise typer.Exit(1)


def _note(trouble: str) -> None:
    """Why costs are missing."""
    if trouble:
        print(f"note: {trouble}")


def _settings(config: Path | None, tariff: Path | None) -> Config:
    settings = configured(config, service="web")
    if tariff is not None:
        settings.energy = settings.energy.model_copy(update={"tariff": tariff})
    return settings


def _listen(settings: Config, otherwise: str = "") -> Heard:
    """What the broker has retained. Raises UserError, with what can be done `otherwise`."""
    from acqd.plant.heard import listen
    from acqd.plant.remembered import file_of, remember

    try:
        address = settings.mqtt.address()
        heard = listen(address)
    except UserError as error:
        raise UserError(f"{error}{otherwise}") from None
    remember(heard, file_of(str(address)))
    return heard


def _found(folder: Path | None) -> dict[str, Row]:
    from acqd.plant.findings import findings

    return {} if folder is None else findings(folder)
