"""`acqd plan`: what a number of robots needs, for a terminal."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.cli.options import Json
from acqd.planning.demand import Demand
from acqd.planning.measured import by_section, replaced, shipped
from acqd.planning.needs import Plan
from acqd.planning.needs import plan as planned

_WHY_AT = 59
"""Column where the assumption begins."""


def plan(
    robots: Annotated[int, typer.Argument(metavar="N", help="Robots, each with a box of its own.")],
    channels: Annotated[int, typer.Option(help="Of a box: three phases and their total are 4.")] = 4,
    rows_per_second: Annotated[float, typer.Option(help="Of a channel; 25 at 50 Hz.")] = 25.0,
    quality: Annotated[str, typer.Option(help="Interval of power quality: 10/12, 150/180, 10min; or off.")] = "off",
    archive: Annotated[float, typer.Option(help="Days of all samples on the PC's disk; 0: none.")] = 0.0,
    days: Annotated[
        float | None, typer.Option(help="Days that rows are kept; default: what --disk holds, else 30.")
    ] = None,
    disk: Annotated[float | None, typer.Option(help="GB for the tables of a database; default: as needed.")] = None,
    cores: Annotated[int, typer.Option(help="Of a measurement PC.")] = 2,
    boxes: Annotated[int, typer.Option(help="At a measurement PC at most; more than 8 were not measured.")] = 8,
    load: Annotated[float, typer.Option(help="Share of a core that may be busy; the rest catches up.")] = 0.5,
    measured: Annotated[
        list[Path] | None, typer.Option(help="JSON of tools.bench or tools.studies.soak.fleet from your computer.")
    ] = None,
    json: Json = False,
) -> None:
    """Computers, brokers, databases, disks and network for N robots, from measured figures.

    A plan on paper: figures of one computer, multiplied. Measure on yours, and give the files to --measured.

    Example: acqd plan 200 --days 90; acqd plan 200 --quality 10min --disk 4000
    """
    demand = Demand(
        robots, channels, rows_per_second, quality, archive, days, disk, cores, boxes, load  # type: ignore[arg-type]
    )  # fmt: skip
    figures = shipped()
    for path in measured or ():
        figures = replaced(figures, path)
    found = planned(demand, figures)
    if json:
        print(orjson.dumps(asdict(found)).decode())
    else:
        print("\n".join(_lines(found)))


def _lines(found: Plan) -> list[str]:
    """The plan, then the figures behind it."""
    lines = [f"{found.demand.robots:,} robots, on paper: measured figures, multiplied"]
    part = ""
    for need in found.needs:
        if need.part != part:
            part = need.part
            lines += ["", part]
        row = f"  {need.name:37}{_number(need.value):>10} {need.unit:7}"
        lines.append(f"{row:{_WHY_AT}}{need.why}".rstrip())
    lines += ["", "measured"]
    shown: set[tuple[str, str]] = set()
    for (command, where, section), quantities in by_section(found.used).items():
        if (command, where) not in shown:
            lines += [f"  {command}", f"    {where}"]
        shown.add((command, where))
        lines += [f"    {section.rstrip(', ')} ..."] * bool(section)
        lines += [f"      {one.name[:62]:64}{_number(one.value):>10} {one.unit}" for one in quantities]
    return lines


def _number(value: float) -> str:
    """Three digits, and all of a large or whole number."""
    return f"{value:,.0f}" if value >= 1_000 or value == int(value) else f"{value:.3g}"
