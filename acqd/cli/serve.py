"""Runs the daemon in the foreground with live numbers, for `acqd run` and `acqd lab execute --live`."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import sys
from pathlib import Path
from typing import Any

import orjson
from rich.live import Live

from acqd.cli.table import energy, power_table
from acqd.cli.terminal import terminal
from acqd.daemon.config import Config
from acqd.daemon.service import Service
from acqd.daemon.tape import Tape
from acqd.errors import UserError
from acqd.telemetry.ports import check_port, free_port

_DEFAULT_PORT = 1883
_UNITS = {"Vrms": "V", "Irms": "A", "P": "W", "PF": "", "f": "Hz"}


def serve(
    settings: Config,
    duration: float | None,
    *,
    json: bool,
    quiet: bool,
    title: str,
    tape: Path | None = None,
    take_name: bool = False,
) -> None:
    """Run the daemon until it ends; `quiet`: no lines where stdout is no terminal; `tape`: a file for all rows.

    `take_name`: another daemon of this device name is to stop publishing.
    """
    console = terminal(stderr=json)
    latest: dict[tuple[str, str], dict[str, Any]] = {}
    live = Live(console=console, auto_refresh=False) if sys.stdout.isatty() and not json else None

    def show(summaries: list[dict[str, Any]]) -> None:
        latest.update({(summary["device"], summary["channel"]): summary for summary in summaries})
        if json:
            sys.stdout.buffer.write(b"".join(orjson.dumps(summary) + b"\n" for summary in summaries))
            sys.stdout.flush()
        elif live is not None:
            live.update(power_table(latest, f"{title}  {summaries[-1]['time']}"), refresh=True)
        elif not quiet:
            console.print(_line(summaries[-1]))

    async def run() -> None:
        service = Service(settings, show, Tape(tape) if tape else None, take_name=take_name)
        gc.freeze()  # what was imported stays: collections look through the objects of rows only
        await service.run(duration)

    with live or contextlib.nullcontext():
        asyncio.run(run())


def announce(settings: Config, what: str, *, json: bool) -> None:
    """Print where the rows of a demonstration go."""
    terminal(stderr=json).print(
        f"{what}; broker mqtt://{settings.mqtt.host}:{settings.mqtt.port}; "
        f"database {Path(settings.sink.database).absolute()}; stop with Ctrl-C; "
        f"look: acqd watch{'' if settings.mqtt.port == _DEFAULT_PORT else f' --port {settings.mqtt.port}'}",
    )


def _line(summary: dict[str, Any]) -> str:
    from acqd.report.digits import quantity  # the room of reports takes its time, and services print no lines

    shown = [f"{name} {quantity(summary[name], unit)}" for name, unit in _UNITS.items()]
    text = "  ".join([*shown, f"W {energy(summary['W'])}"])
    return f"{summary['time']} {summary['device']} {summary['channel']:5} {text}  {' '.join(summary['flags'])}"


def demonstration_port() -> int:
    """The usual MQTT port; a free port when it is in use."""
    try:
        check_port("127.0.0.1", _DEFAULT_PORT)
    except UserError:
        port = free_port()
        print(f"acqd: port {_DEFAULT_PORT} is in use; the embedded broker takes {port}", file=sys.stderr)
        return port
    return _DEFAULT_PORT
