"""`acqd modbus`: what answers on a Modbus link."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from acqd.cli.options import Json
from acqd.errors import UserError
from acqd.sources.spec import device_module

app = typer.Typer(help="Modbus: RMS meters and waveform bridges.", no_args_is_help=True)


@app.callback()
def modbus() -> None:
    """Modbus: RMS meters and waveform bridges."""


@app.command()
def probe(
    host: Annotated[str | None, typer.Option(help="Modbus TCP: address of the meter or gateway.")] = None,
    port: Annotated[int, typer.Option(min=1, max=65535)] = 502,
    serial_port: Annotated[str | None, typer.Option(help="Modbus RTU: /dev/ttyUSB0.")] = None,
    baudrate: Annotated[int, typer.Option(min=300)] = 9600,
    parity: Annotated[str, typer.Option(help="N, E or O.")] = "N",
    stopbits: Annotated[int, typer.Option(min=1, max=2)] = 1,
    units: Annotated[str, typer.Option(help="Unit ids: 1, 1-10 or 1,5,7.")] = "1",
    nominal_voltage: Annotated[float, typer.Option(min=1.0, help="Expected line-to-neutral voltage in V.")] = 230.0,
    timeout: Annotated[float, typer.Option(min=0.02, help="Seconds an answer may take.")] = 0.3,
    every: Annotated[bool, typer.Option("--all", help="Also show the profiles that do not fit, and why.")] = False,
    json: Json = False,
) -> None:
    """Find the profile whose registers make sense. Only reads; writes nothing to any meter.

    Example: acqd modbus probe --serial-port /dev/ttyUSB0 --baudrate 9600 --units 1-10
    """
    if (host is None) == (serial_port is None):
        raise UserError("modbus probe: give either --host or --serial-port")
    if parity not in ("N", "E", "O"):
        raise UserError(f"--parity {parity!r}: expected N, E or O")
    numbers = _units(units)
    link = device_module("modbus").ModbusLink(host, port, serial_port, baudrate, parity, stopbits, timeout)
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task(f"asking {link}", total=len(numbers))
        found = list(
            device_module("meters.probe").probe(link, numbers, nominal_voltage, lambda _unit: progress.advance(bar))
        )
    found.sort(key=lambda one: (one.unit, *(not part if isinstance(part, bool) else -part for part in one.rank)))
    if json:
        print(orjson.dumps([asdict(one) | {"rank": one.rank} for one in found]).decode())
    elif found:
        _print(found, every)
    if not found:
        what = "the unit ids" if host else "wiring, baud rate, parity and unit ids"
        raise UserError(f"{link}: nobody answers to --units {units}; check {what}")
    if not any(one.rank[0] for one in found):
        raise typer.Exit(1)


def _units(text: str) -> list[int]:
    """`1-3,7` -> [1, 2, 3, 7]. Raises UserError."""
    numbers: list[int] = []
    for item in text.split(","):
        first, _, last = item.partition("-")
        if not first.strip().isdigit() or (last and not last.strip().isdigit()):
            raise UserError(f"--units {text!r}: expected unit ids like 1, 1-10 or 1,5,7")
        numbers += range(int(first), int(last or first) + 1)
    if not numbers or max(numbers) > 255:
        raise UserError(f"--units {text!r}: expected unit ids from 0 to 255")
    return numbers


def _print(found: list[Any], every: bool) -> None:
    """A table of what fits (or of all), then a sentence for each unit."""
    shown = [one for one in found if every or one.rank[0]]
    if shown:
        Console().print(_table(shown))
    for unit in dict.fromkeys(one.unit for one in found):
        print(f"unit {unit}: {_verdict([one for one in found if one.unit == unit])}")
    if not every:
        print(f"{len(found) - len(shown)} profiles that do not fit are not shown; --all shows them and why")


def _table(candidates: list[Any]) -> Table:
    table = Table(
        "unit", "profile", "fits", "identified", "relations that hold", "reads as", "remark", title="Modbus probe"
    )
    for one in candidates:
        values = ((name, one.values.get(name)) for name in ("L1.Vrms", "L1.P", "f"))
        table.add_row(
            str(one.unit),
            one.profile,
            "[green]yes[/]" if one.fits else "[red]no[/]",
            {True: "yes", False: "another model", None: "-"}[one.identified],
            str(one.checks),
            ", ".join(f"{name} {value:.5g}" for name, value in values if value is not None) if one.fits else "",
            escape(one.remark),
        )
    return table


def _verdict(candidates: list[Any]) -> str:
    """What is known of one unit, best first."""
    best = [one for one in candidates if one.rank[0]]
    if best:
        others = [one.profile for one in best[1:] if not (best[0].identified and not one.identified)]
        doubt = f"; {', '.join(others)} cannot be told apart from it by the registers alone" if others else ""
        return f"profile {best[0].profile} fits best{doubt}"
    close = [one for one in candidates if "make sense" in one.remark]
    close.sort(key=lambda one: one.identified is not True)
    if close:
        return f"no profile fits as it is; {close[0].profile}: {close[0].remark}"
    return "no profile fits"
