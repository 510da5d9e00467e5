"""Measures everything that acqd promises and prints the figures next to their targets.

    make bench [ARGS="--only speed --out bench.json"]

The figures also go to a JSON file.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from acqd.errors import OperationError
from tools.bench import (
    accuracy,
    archive,
    at_work,
    crowd,
    delivery,
    events,
    flicker,
    jumps,
    lab,
    live,
    load,
    models,
    quality,
    sink,
    sources,
    speed,
    web,
)
from tools.bench.report import Figure, table
from tools.common.tables import show

_SECTIONS: dict[str, list[Callable[[], Iterator[Figure]]]] = {
    "accuracy": [accuracy.synthetic, accuracy.exactness, jumps.jumps, accuracy.recordings],
    "quality": [quality.quality, quality.beside],
    "cost": [quality.cost],
    "events": [events.disturbances, events.steady, events.cost],
    "flicker": [flicker.pinst, flicker.pst],
    "speed": [speed.pqopen, speed.kernel, speed.replay, speed.main_slow],
    "live": [live.daemon, live.from_file, live.jitter],
    "boxes": [live.boxes],
    "everything": [live.everything],
    "archive": [archive.cost, archive.again],
    "busy": [live.busy],
    "sources": [sources.sources],
    "sink": [sink.sinks],
    "delivery": [delivery.stores, delivery.drains],
    "load": [load.loads],
    "lab": [lab.motions, lab.campaign],
    "models": [models.time_shifts, models.training_step, models.thesis_campaign],
    "work": [at_work.fmu_and_sidecar],
    "web": [web.page],
    "crowd": [crowd.crowd],
}


def chosen(only: list[str] | None) -> list[str]:
    """Sections of `--only`, which may be given several times. Raises OperationError for a name that is no section."""
    names = [name.strip() for each in only or _SECTIONS for name in each.split(",")]
    for name in names:
        if name not in _SECTIONS:
            raise OperationError(f"--only {name}: no such section; expected {', '.join(_SECTIONS)}")
    return names


def bench(
    only: Annotated[
        list[str] | None, typer.Option(help=f"Sections, with commas between: {', '.join(_SECTIONS)}.")
    ] = None,
    out: Annotated[Path, typer.Option(help="JSON file to write.")] = Path("bench.json"),
) -> None:
    """Measure everything, print a table and write the figures to a JSON file."""
    figures: list[Figure] = []
    progress = Console(stderr=True)
    for name in chosen(only):
        for measure in _SECTIONS[name]:
            with progress.status(f"measuring {name}: {measure.__name__}"):
                figures += measure()
    show(table(figures), width=140)
    out.write_text(
        json.dumps([asdict(figure) | {"value": float(figure.value), "met": figure.met} for figure in figures], indent=1)
    )
    missed = sum(figure.met is False for figure in figures)
    print(f"{missed} of {sum(figure.met is not None for figure in figures)} targets missed; figures in {out}")


if __name__ == "__main__":
    # A BLAS with two threads would make every ratio meaningless.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(bench)
    try:
        app()
    except OperationError as error:
        sys.exit(f"bench: {error}")
