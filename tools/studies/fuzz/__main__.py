"""Mutated inputs to every parser of acqd: counts what is taken, refused in one line, and what must never happen.

python -m tools.studies.fuzz --inputs 50000 --seed 1
python -m tools.studies.fuzz --parser npz --inputs 200000 --keep failing
python -m tools.studies.fuzz --guided config --inputs 100000      # atheris: by coverage (pip install atheris)
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from acqd.cli.main import for_people
from acqd.errors import UserError
from tools.studies.fuzz.campaign import Limits, Tally, run_parser
from tools.studies.fuzz.targets import TARGETS

_NAMES = [one.name for one in TARGETS]


def fuzz(
    parser: Annotated[list[str] | None, typer.Option(help=f"One of {', '.join(_NAMES)}; default: all.")] = None,
    inputs: Annotated[int, typer.Option(min=1, help="Inputs for each parser.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Same seed, same inputs.")] = 1,
    seconds: Annotated[float, typer.Option(min=0.1, help="Longest time of one input.")] = 5.0,
    keep: Annotated[Path | None, typer.Option(help="Folder for inputs that fail, each as a ZIP.")] = None,
    guided: Annotated[str | None, typer.Option(help="Fuzz this parser with atheris instead, by coverage.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Fuzz the parsers; exit 1 when an input is neither taken nor refused in one line."""
    for name in [*(parser or []), *([guided] if guided else [])]:
        if name not in _NAMES:
            raise UserError(f"parser {name!r} is unknown; known: {', '.join(_NAMES)}")
    if guided is not None:
        from tools.studies.fuzz.guided import fuzz_by_coverage

        fuzz_by_coverage(guided, inputs, seed, seconds)
        return
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
    begun, tallies, console = time.monotonic(), [], Console(stderr=True)
    for name in parser or _NAMES:
        with console.status(name) as status:
            limits = Limits(seconds)

            def shown(number: int, name: str = name) -> None:
                status.update(f"{name}: {number} of {inputs}")

            tallies.append(run_parser(name, seed, inputs, limits, keep, shown))
        console.print(f"{name}: {inputs} inputs, {tallies[-1].failures.total()} failures", highlight=False)
    took = time.monotonic() - begun
    if json:
        parsers = [tally.as_json() for tally in tallies]
        print(orjson.dumps({"seconds": round(took, 1), "seed": seed, "parsers": parsers}).decode())
    else:
        _print(tallies, took)
    if any(tally.failures for tally in tallies):
        raise typer.Exit(1)


def _print(tallies: list[Tally], seconds: float) -> None:
    table = Table("parser", "inputs", "taken", "refused in one line", "failures")
    for tally in tallies:
        table.add_row(tally.parser, *map(str, (tally.inputs, tally.accepted, tally.refused, tally.failures.total())))
    together = [
        sum(tally.inputs for tally in tallies),
        sum(tally.accepted for tally in tallies),
        sum(tally.refused for tally in tallies),
        sum(tally.failures.total() for tally in tallies),
    ]
    table.add_row("together", *map(str, together))
    console = Console()
    console.print(table)
    for tally in tallies:
        for reason, times in tally.failures.most_common():
            console.print(f"{tally.parser}: {times} x {escape(reason)}")
    console.print(f"{seconds:.0f} s")


def main() -> None:
    """The command."""
    typer.run(fuzz)


if __name__ == "__main__":
    for_people(main)
