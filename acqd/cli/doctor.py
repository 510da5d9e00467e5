"""`acqd doctor`: checks whether this host and this configuration are fit to meter."""

from __future__ import annotations

from dataclasses import asdict

import orjson
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from acqd.cli.options import ConfigFile, Json, configured
from acqd.daemon.finding import Finding
from acqd.daemon.health.runbook import entry_for

_COLOUR = {"ok": "green", "warn": "yellow", "fail": "red"}


def doctor(config: ConfigFile = None, json: Json = False) -> None:
    """Check the host, the source, the broker and the database; exit 1 when something will not work.

    Example: acqd doctor --config /etc/acqd/acqd.toml
    """
    from acqd.daemon.checks import all_checks

    findings = all_checks(configured(config))
    if json:
        print(orjson.dumps([asdict(finding) | {"runbook": _link(finding)} for finding in findings]).decode())
    else:
        table = Table("check", "", "finding", "what to do")
        for finding in findings:
            shown = f"[{_COLOUR[finding.state]}]{finding.state}[/]"
            table.add_row(finding.check, shown, escape(finding.finding), escape(finding.advice))
        console = Console()
        console.print(table)
        for finding in findings:
            _advise(console, finding)
    if any(finding.state == "fail" for finding in findings):
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
