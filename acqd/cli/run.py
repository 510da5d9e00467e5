"""`acqd run`: the daemon."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acqd.cli.options import ConfigFile, Json, config_file
from acqd.cli.serve import announce, demonstration_port, serve
from acqd.daemon.config import Config
from acqd.daemon.config_file import load_config
from acqd.errors import UserError
from acqd.telemetry.topics import valid_device


def run(
    config: ConfigFile = None,
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds.")] = None,
    lines: Annotated[bool, typer.Option("--lines", help="Show a line a second although --config is given.")] = False,
    tape: Annotated[Path | None, typer.Option(help="Append every row to this file (JSON lines).")] = None,
    device: Annotated[str | None, typer.Option(help="Name in rows and topics (default: the config's).")] = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Port of the broker.")] = None,
    take_name: Annotated[
        bool, typer.Option("--take-name", help="Another daemon of this device name is to stop publishing.")
    ] = False,
    database: Annotated[str | None, typer.Option(help="SQLite file of a run without --config.")] = None,
    json: Json = False,
) -> None:
    """Meter a source and publish the rows.

    Without any acqd.toml, or with --database or --port: simulated source, embedded broker, SQLite file, live numbers.

    Example: acqd run --config config/acqd.toml
    """
    if config and database is not None:
        raise UserError("--database is for a run without --config: with one, acqd sink stores the rows")
    if device is not None and not valid_device(device):
        raise UserError(f"--device {device!r}: expected 1 to 64 letters, digits, dots, dashes or underscores")
    if database is None and port is None:
        config = config_file(config)
    settings = load_config(config) if config else Config.demonstration(port or demonstration_port())
    settings.device = device or settings.device
    settings.mqtt.port = port or settings.mqtt.port
    settings.sink.database = database or settings.sink.database
    if not config:
        announce(settings, "simulated source", json=json)
    serve(
        settings,
        duration,
        json=json,
        quiet=config is not None and not lines,
        title="acqd run",
        tape=tape,
        take_name=take_name,
    )
