"""`acqd status`: how the services of this computer are."""

from __future__ import annotations

import sys
from dataclasses import asdict
from enum import StrEnum
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console
from rich.markup import escape

from acqd.cli.boxes_table import flagged, seconds, show_boxes
from acqd.cli.folded_table import Table
from acqd.cli.options import ConfigFile, Json, configured
from acqd.daemon.health.query import SERVICES, Answer, ask
from acqd.daemon.health.runbook import entry_for
from acqd.errors import UserError


class Only(StrEnum):
    """Services that can be asked."""

    daemon = "daemon"
    sink = "sink"


def status(
    config: ConfigFile = None,
    only: Annotated[Only | None, typer.Option(help="Ask this service only.")] = None,
    acknowledge: Annotated[
        bool, typer.Option(help="You have seen what was dropped or quarantined: notes from now on.")
    ] = False,
    json: Json = False,
) -> None:
    """Ask the daemon and the sink on this computer how they are; exit 0 when rows arrive, 1 when not.

    Example: acqd status --config /etc/acqd/acqd.toml
    """
    section = configured(config).health
    wanted = [service for service in SERVICES if only is None or service == only.value]
    answers = [
        answer
        for answer in (ask(section, service, acknowledge=acknowledge) for service in wanted)
        if answer is not None
    ]
    if not answers:
        raise UserError("health.port and health.sink_port are 0: the services have no endpoints to ask")
    for service in {*wanted} - {answer.service for answer in answers}:
        key = "port" if service == "daemon" else "sink_port"
        print(f"acqd: {service} is not asked: [health] {key} is 0", file=sys.stderr)
    healthy = all(answer.ready for answer in answers)
    if json:
        print(orjson.dumps({"healthy": healthy, "services": [asdict(answer) for answer in answers]}).decode())
    else:
        _show(answers)
    if not healthy:
        raise typer.Exit(1)


def _show(answers: list[Answer]) -> None:
    table = Table("", *(answer.service for answer in answers))
    for title, cell in _LINES.items():
        cells = [cell(answer.status) if answer.status else "" for answer in answers]
        if any(cells):
            table.add_row(title, *(escape(text) for text in cells))
    console = Console()
    if table.row_count:  # no service has answered: only what follows
        console.print(table)
    for answer in answers:
        show_boxes(console, answer.status.get("boxes") or [])
    for answer in answers:
        for problem in answer.problems:
            console.print(f"[red]{answer.service}:[/] {escape(problem)}", soft_wrap=True)
            _advise(console, problem)
        for note in answer.notes:
            console.print(f"[yellow]{answer.service}:[/] {escape(note)}", soft_wrap=True)
            _advise(console, note)


def _advise(console: Console, sentence: str) -> None:
    """The line of the runbook that mends it."""
    entry = entry_for(sentence)
    if entry is not None:
        console.print(f"  {escape(entry.plain_steps)} ({entry.link})", soft_wrap=True, highlight=False)


def _link(name: str, status: dict[str, Any]) -> str:
    link = status.get(name)
    if not link:
        return ""
    count = link["reconnects"]
    again = f", reconnected {count} time{'s' if count > 1 else ''}" if count else ""
    return ("connected" if link["connected"] else "away") + again


def _delivery(status: dict[str, Any]) -> str:
    delivery = status.get("delivery")
    if not delivery:
        return ""
    parts = [f"{delivery['waiting']} wait", f"{delivery['dropped']} dropped"]
    if delivery["receipts_outstanding"] is not None:
        parts.append(f"{delivery['receipts_outstanding']} without receipt")
    return ", ".join(parts)


def _spool(status: dict[str, Any]) -> str:
    delivery = status.get("delivery") or {}
    if delivery.get("spool_bytes") is None:
        return ""
    limit = delivery["spool_limit_bytes"]
    share = f" of {limit / 1e6:.0f} MB" if limit else ""
    return f"{delivery['spool_bytes'] / 1e6:.1f} MB{share}, oldest row {seconds(delivery['spool_age_s'])}"


def _cycles(status: dict[str, Any]) -> str:
    cycles = status.get("cycles")
    if not cycles:
        return ""
    return f"{cycles['late']} late, {cycles['missed']} missed of {cycles['cycles']}"


def _clock(status: dict[str, Any]) -> str:
    return {True: "synchronised", False: "not synchronised"}.get(status.get("synchronised"), "")  # type: ignore[arg-type]


_LINES = {
    "name": lambda status: str(status["name"]),
    "boot": lambda status: status.get("boot") or "",
    "running for": lambda status: seconds(status["uptime_s"]),
    "rows": lambda status: str(status["rows"]),
    "last row": lambda status: f"{seconds(status['last_row_age_s'])} ago" if status["last_row_age_s"] else "none yet",
    "source": lambda status: _link("source", status),
    "broker": lambda status: _link("broker", status),
    "database": lambda status: _link("database", status),
    "messages": _delivery,
    "spool": _spool,
    "MAIN_FAST cycles": _cycles,
    "windows": lambda status: flagged(status.get("windows")),
    "quarantined": lambda status: "" if status.get("quarantined") is None else str(status["quarantined"]),
    "clock": _clock,
}
