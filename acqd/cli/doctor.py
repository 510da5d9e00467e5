"""`acqd doctor`: checks whether this host and this configuration are fit to meter."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import orjson
import typer
from rich.console import Console
from rich.markup import escape

from acqd.cli.findings_table import findings_table
from acqd.cli.options import ConfigFile, Json, configured
from acqd.cli.phasor_diagram import print_wiring
from acqd.daemon.config import Config
from acqd.daemon.finding import Finding
from acqd.daemon.health.runbook import entry_for
from acqd.errors import UserError


def doctor(
    wiring: Annotated[
        bool, typer.Option("--wiring", help="Examine transformers and terminals of the running daemon's device.")
    ] = False,
    device: Annotated[str, typer.Option(help="Of --wiring: which source, where the daemon has several.")] = "",
    seconds: Annotated[
        float | None, typer.Option(min=1.0, max=600.0, help="Of --wiring: how long, in s (default 60).")
    ] = None,
    power: Annotated[
        float | None,
        typer.Option(
            min=-1e9, max=1e9, help="Of --wiring: W that the load takes; else a sidecar's prediction, if any."
        ),
    ] = None,
    rated: Annotated[
        float | None, typer.Option(min=1.0, help="Of --wiring: W that the load takes at most, from its nameplate.")
    ] = None,
    config: ConfigFile = None,
    json: Json = False,
) -> None:
    """Check the host, the source, the broker and the database; exit 1 when something will not work.

    Example: acqd doctor --config /etc/acqd/acqd.toml; acqd doctor --wiring
    """
    if wiring:
        _wiring(configured(config), device, seconds or 60.0, (power, rated), json=json)
        return
    if device or (seconds, power, rated) != (None, None, None):
        raise UserError("--device, --seconds, --power and --rated are for --wiring; give that too, or leave them out")
    from acqd.daemon.checks import all_checks

    findings = all_checks(configured(config))
    if json:
        print(orjson.dumps([asdict(finding) | {"runbook": _link(finding)} for finding in findings]).decode())
    else:
        console = Console()
        console.print(findings_table(findings))
        for finding in findings:
            _advise(console, finding)
    if any(finding.state == "fail" for finding in findings):
        raise typer.Exit(1)


def _wiring(
    config: Config, device: str, seconds: float, load: tuple[float | None, float | None], *, json: bool
) -> None:
    """Phasor diagram and findings, for a `load` of a power and a rated power; exit 1 where something is wrong."""
    from acqd.daemon.wiring_check import examine_wiring

    found = examine_wiring(config, device, seconds, *load)
    if json:
        print(orjson.dumps(found).decode())
    else:
        print_wiring(found)
    if found["findings"]:
        raise typer.Exit(1)


def _advise(console: Console, finding: Finding) -> None:
    """The line of the runbook for a finding that is not in order."""
    entry = entry_for(f"doctor: {finding.check}") if finding.state != "ok" else None
    if entry is not None:
        text = f"{finding.check}: {entry.plain_steps} ({entry.link})"
        console.print(escape(text), soft_wrap=True, highlight=False)


def _link(finding: Finding) -> str:
    entry = entry_for(f"doctor: {finding.check}") if finding.state != "ok" else None
    return entry.link if entry is not None else ""
