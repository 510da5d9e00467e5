"""`acqd run`: the daemon."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acqd.cli.options import ConfigFile, Json
from acqd.cli.serve import announce, demonstration_port, serve
from acqd.daemon.config import Config, load_config


def run(
    config: ConfigFile = None,
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds.")] = None,
    lines: Annotated[bool, typer.Option("--lines", help="Show a line a second although --config is given.")] = False,
    tape: Annotated[Path | None, typer.Option(help="Append every row to this file (JSON lines).")] = None,
    json: Json = False,
) -> None:
    """Meter a source and publish the rows.

    Without --config: simulated source, embedded broker, SQLite file acqd.sqlite, live numbers.

    Example: acqd run --config config/acqd.toml
    """
    settings = load_config(config) if config else Config.demonstration(demonstration_port())
    if not config:
        announce(settings, "simulated source", json=json)
    serve(settings, duration, json=json, quiet=config is not None and not lines, title="acqd run", tape=tape)
