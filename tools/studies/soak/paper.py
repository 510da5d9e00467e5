"""What many devices would need, computed from the figures of a load.

    python -m tools.studies.soak.fleet --json > fleet.json
    python -m tools.studies.soak.paper fleet.json [--devices 10000] [--days 30] [--busy 0.5]

Everything is taken as proportional to rows/s: that is a plan on paper, nobody has run it.
"""

from __future__ import annotations

import json as json_
import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from acqd.cli.main import for_people
from acqd.errors import UserError
from tools.bench.report import Figure, table
from tools.common.tables import show

ROWS_PER_DEVICE = 100
"""Per second: 4 channels, 25 windows."""
_DAY_S = 86_400
_NIGHT_S = 4 * 3600


def paper(
    measured: Annotated[Path, typer.Argument(help="What tools.studies.soak.fleet --json has printed.")],
    devices: Annotated[int, typer.Option(min=1, help="How many.")] = 10_000,
    days: Annotated[float, typer.Option(min=0, help="How long rows are kept.")] = 30.0,
    busy: Annotated[float, typer.Option(min=0.05, max=1, help="Share of a core that may be busy.")] = 0.5,
    json: Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")] = False,
) -> None:
    """Extrapolate a measured load to many devices.

    Example: python -m tools.studies.soak.paper fleet.json --devices 10000
    """
    try:
        values = {figure["name"]: float(figure["value"]) for figure in json_.loads(measured.read_text())}
        figures = extrapolated(values, devices, days, busy)
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise UserError(f"{measured}: expected the output of tools.studies.soak.fleet --json ({error})") from None
    if json:
        print(json_.dumps([asdict(figure) for figure in figures]))
    else:
        show(table(figures, "on paper"), width=120)


def extrapolated(measured: dict[str, float], devices: int, days: float, busy: float) -> list[Figure]:
    """The plan. Raises KeyError when a figure is missing."""
    rows, rate = devices * ROWS_PER_DEVICE, measured["stored"]
    whole = f"{devices} devices, processes at {100 * busy:.0f} % of a core"
    shares = {"sinks": "CPU of sinks", "brokers (mosquitto, one core each)": "CPU of mosquitto"}
    found = [Figure(whole, "rows", rows, "1/s")]
    for name, share in shares.items():
        each = busy * 100 / measured[share] * rate
        found.append(Figure(whole, f"{name}", math.ceil(rows / each), ""))
        found.append(Figure(whole, f"devices for each of the {name.split(' (')[0]}", each // ROWS_PER_DEVICE, ""))
    database = measured["CPU of PostgreSQL"] / 100 * rows / rate / busy
    found += [
        Figure(whole, "cores for PostgreSQL", math.ceil(database), ""),
        Figure(whole, "network into the brokers", rows * measured["a row as a packet of MQTT"] * 8 / 1e9, "Gbit/s"),
        Figure(whole, "log of PostgreSQL", rows * measured["a row in PostgreSQL's log"] / 1e6, "MB/s"),
        Figure(whole, "tables", rows * measured[_ON_DISK] * _DAY_S / 1e12, "TB/day"),
        Figure(whole, f"tables, {days:g} days", rows * measured[_ON_DISK] * _DAY_S * days / 1e12, "TB"),
        Figure(whole, "an hour of outage is caught up after", busy / (1 - busy) if busy < 1 else math.inf, "h"),
        Figure(whole, "a spool of 1 GB lasts", 1e9 / (ROWS_PER_DEVICE * _SPOOLED) / 3600, "h"),
        Figure(whole, "one-minute roll-ups", devices * 4 / 60, "rows/s"),
    ]
    rolled, deleted = (measured[f"{name}, time per row"] for name in ("roll-ups (acqd sink maintain)", "deletion"))
    day_s = ROWS_PER_DEVICE * _DAY_S * (2 * rolled + deleted) / 1e6  # a day and, for late rows, the one before
    found.append(
        Figure("one database", f"devices, with {_NIGHT_S / 3600:g} h for the nightly run", _NIGHT_S // day_s, "")
    )
    return found


_ON_DISK = "a row in PostgreSQL, with its indices"
_SPOOLED = 335
"""Bytes of a row in the spool: `python -m tools.bench --only delivery`, with a payload of 300 bytes."""


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(paper)
    for_people(app)
