"""`acqd run`: the daemon."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console
from rich.live import Live

from acqd.cli.options import ConfigFile, Json
from acqd.cli.table import power_table
from acqd.daemon.config import Config, load_config
from acqd.daemon.service import Service
from acqd.errors import UserError
from acqd.telemetry.broker import check_port, free_port

_DEFAULT_PORT = 1883


def run(
    config: ConfigFile = None,
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds.")] = None,
    json: Json = False,
) -> None:
    """Meter a source and publish the rows.

    Without --config: simulated source, embedded broker, SQLite file acqd.sqlite, live numbers.

    Example: acqd run --config config/acqd.toml
    """
    settings = load_config(config) if config else Config.demonstration(_demonstration_port())
    console = Console(stderr=json)
    latest: dict[tuple[str, str], dict[str, Any]] = {}
    live = Live(console=console, auto_refresh=False) if sys.stdout.isatty() and not json else None
    quiet = config is not None and live is None and not json
    if not config:
        console.print(
            f"simulated source; broker mqtt://{settings.mqtt.host}:{settings.mqtt.port}; "
            f"database {Path(settings.sink.database).absolute()}; stop with Ctrl-C",
            soft_wrap=True,
        )

    def show(summaries: list[dict[str, Any]]) -> None:
        latest.update({(summary["device"], summary["channel"]): summary for summary in summaries})
        if json:
            sys.stdout.buffer.write(b"".join(orjson.dumps(summary) + b"\n" for summary in summaries))
            sys.stdout.flush()
        elif live is not None:
            live.update(power_table(latest, f"acqd run  {summaries[-1]['time']}"), refresh=True)
        elif not quiet:
            console.print(_line(summaries[-1]), soft_wrap=True, highlight=False)

    async def serve() -> None:
        await Service(settings, show).run(duration)

    with live or contextlib.nullcontext():
        asyncio.run(serve())


def _line(summary: dict[str, Any]) -> str:
    values = ((name, summary[name]) for name in ("Vrms", "Irms", "P", "PF", "f", "W"))
    text = "  ".join(f"{name} {'-' if value is None else f'{value:.6g}'}" for name, value in values)
    return f"{summary['time']} {summary['channel']:5} {text}  {' '.join(summary['flags'])}"


def _demonstration_port() -> int:
    try:
        check_port("127.0.0.1", _DEFAULT_PORT)
    except UserError:
        port = free_port()
        print(f"acqd: port {_DEFAULT_PORT} is in use; the embedded broker takes {port}", file=sys.stderr)
        return port
    return _DEFAULT_PORT
