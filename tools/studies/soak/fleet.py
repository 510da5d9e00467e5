"""50 devices for minutes through one mosquitto and one sink into PostgreSQL: nothing lost, less than a core.

    python -m tools.studies.soak.fleet [--minutes 10] [--json]

Rows as 50 daemons send them (4 channels, 25 rows/s each), simulated, from one process. `make bench ARGS="--only load"`
runs 30 s of the same.
"""

from __future__ import annotations

import json as json_
from dataclasses import asdict
from typing import Annotated

import typer

from acqd.cli.main import for_people
from tools.bench.load import steady
from tools.bench.report import table
from tools.common.ending import end_in_order
from tools.common.tables import show


def fleet(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long.")] = 10.0,
    json: Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")] = False,
) -> None:
    """Send rows at the rate of 50 devices and count what is stored.

    Example: python -m tools.studies.soak.fleet --minutes 1
    """
    end_in_order()
    figures = list(steady(60 * minutes))
    if json:
        print(json_.dumps([asdict(figure) | {"met": figure.met} for figure in figures]))
    else:
        show(table(figures, "50 devices (simulated rows)"), width=120)
    raise SystemExit(0 if all(figure.met is not False for figure in figures) else 1)


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(fleet)
    for_people(app)
