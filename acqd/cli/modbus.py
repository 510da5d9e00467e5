"""`acqd modbus`: finds out what answers on a Modbus link."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from acqd.cli.folded_table import Table
from acqd.cli.options import Json, bare
from acqd.errors import UserError
from acqd.numerals import whole_number
from acqd.sources.spec import device_module

app = typer.Typer(help="Modbus: RMS meters and waveform bridges.", no_args_is_help=True)


@app.callback()
def modbus() -> None:
    """Modbus: RMS meters and waveform bridges."""


@app.command()
def probe(
    host: Annotated[
        str | None, typer.Option(callback=bare, help="Modbus TCP: address of the meter or gateway.")
    ] = None,
    port: Annotated[int, typer.Option(min=1, max=65535)] = 502,
    rtu: Annotated[bool, typer.Option("--rtu", help="With --host: a gateway that passes RTU frames on.")] = False,
    ascii_: Annotated[bool, typer.Option("--ascii", help="Modbus ASCII, of the serial line or of a gateway.")] = False,
    serial_port: Annotated[str | None, typer.Option(help="Modbus RTU or ASCII: /dev/ttyUSB0.")] = None,
    baudrate: Annotated[int, typer.Option(min=300)] = 9600,
    parity: Annotated[str, typer.Option(help="N, E or O.")] = "N",
    stopbits: Annotated[int, typer.Option(min=1, max=2)] = 1,
    databits: Annotated[int, typer.Option(min=7, max=8, help="7: with --ascii.")] = 8,
    units: Annotated[str, typer.Option(help="Unit ids: 1, 1-10 or 1,5,7.")] = "1",
    nominal_voltage: Annotated[float, typer.Option(min=1.0, help="Expected line-to-neutral voltage in V.")] = 230.0,
    timeout: Annotated[float, typer.Option(min=0.02, help="Seconds an answer may take.")] = 0.3,
    every: Annotated[bool, typer.Option("--all", help="Also show the profiles that do not fit, and why.")] = False,
    json: Json = False,
) -> None:
    """Find the profile whose registers make sense. The probe only reads; it writes to no meter.

    Example: acqd modbus probe --serial-port /dev/ttyUSB0 --baudrate 9600 --units 1-10
    """
    if (host is None) == (serial_port is None):
        raise UserError("modbus probe: give either --host or --serial-port")
    if parity not in ("N", "E", "O"):
        raise UserError(f"--parity {parity!r}: expected N, E or O")
    if rtu and ascii_:
        raise UserError("modbus probe: give either --rtu or --ascii")
    if databits == 7 and not ascii_:
        raise UserError("--databits 7 needs --ascii: bytes of RTU have 8")
    numbers = _units(units)
    link = device_module("modbus").ModbusLink(
        host, port, serial_port, baudrate, parity, stopbits, timeout, "ascii" if ascii_ else "rtu" if rtu else "tcp",
        databits=databits,
    )  # fmt: skip
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task(f"asking {link}", total=len(numbers))
        probing = device_module("meters.probe").probe
        candidates = list(probing(link, numbers, nominal_voltage, lambda _unit: progress.advance(bar)))
    candidates.sort(key=_unit_then_rank)
    if json:
        print(orjson.dumps([asdict(candidate) | {"rank": candidate.rank} for candidate in candidates]).decode())
    elif candidates:
        _print(candidates, every)
    if not candidates:
        what = "the unit ids" if host else "wiring, baud rate, parity and unit ids"
        raise UserError(f"{link}: nobody answers to --units {units}; check {what}")
    if not any(candidate.rank[0] for candidate in candidates):
        raise typer.Exit(1)


def _unit_then_rank(candidate: Any) -> tuple[Any, ...]:
    """Sort key: by unit, then the best candidates first."""
    return candidate.unit, *(not part if isinstance(part, bool) else -part for part in candidate.rank)


def _units(text: str) -> list[int]:
    """`1-3,7` -> [1, 2, 3, 7]. Raises UserError."""
    numbers: list[int] = []
    for item in text.split(","):
        first, _, last = item.partition("-")
        begin, end = whole_number(first.strip(), 3), whole_number((last or first).strip(), 3)
        if begin is None or end is None:
            raise UserError(f"--units {text!r}: expected unit ids like 1, 1-10 or 1,5,7")
        numbers += range(begin, end + 1)
    if not numbers or max(numbers) > 255:
        raise UserError(f"--units {text!r}: expected unit ids from 0 to 255")
    return numbers


def _print(candidates: list[Any], every: bool) -> None:
    """Print a table of the profiles that fit (or of all), then a sentence for each unit."""
    shown = [candidate for candidate in candidates if every or candidate.rank[0]]
    if shown:
        Console().print(_table(shown))
    for unit in dict.fromkeys(candidate.unit for candidate in candidates):
        print(f"unit {unit}: {_verdict([candidate for candidate in candidates if candidate.unit == unit])}")
    if not every:
        print(f"{len(candidates) - len(shown)} profiles that do not fit are not shown; --all shows them and why")


def _table(candidates: list[Any]) -> Table:
    table = Table(
        "unit", "profile", "fits", "identified", "relations that hold", "reads as", "remark", title="Modbus probe"
    )
    for candidate in candidates:
        values = ((name, candidate.values.get(name)) for name in ("L1.Vrms", "L1.P", "f"))
        table.add_row(
            str(candidate.unit),
            candidate.profile,
            "[green]yes[/]" if candidate.fits else "[red]no[/]",
            {True: "yes", False: "another model", None: "-"}[candidate.identified],
            str(candidate.checks),
            ", ".join(f"{name} {value:.5g}" for name, value in values if value is not None) if candidate.fits else "",
            escape(candidate.remark),
        )
    return table


def _verdict(candidates: list[Any]) -> str:
    """A sentence about one unit; its candidates come best first."""
    best = [candidate for candidate in candidates if candidate.rank[0]]
    if best:
        others = [candidate.profile for candidate in best[1:] if not (best[0].identified and not candidate.identified)]
        doubt = f"; {', '.join(others)} cannot be distinguished from it by the registers" if others else ""
        return f"profile {best[0].profile} fits best{doubt}"
    close = [candidate for candidate in candidates if "make sense" in candidate.remark]
    close.sort(key=lambda candidate: candidate.identified is not True)
    if close:
        return f"no profile fits as it is; {close[0].profile}: {close[0].remark}"
    return "no profile fits"
