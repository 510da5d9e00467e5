"""`acqd doctor`: checks whether this host and this configuration are fit to meter."""

from __future__ import annotations

import orjson
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from acqd.cli.options import ConfigFile, Json, configured
from acqd.daemon.checks import all_checks

_COLOUR = {"ok": "green", "warn": "yellow", "fail": "red"}


def doctor(config: ConfigFile = None, json: Json = False) -> None:
    """Check the host, the source, the broker and the database; exit 1 when something will not work.

    Example: acqd doctor --config /etc/acqd/acqd.toml
    """
    findings = all_checks(configured(config))
    if json:
        print(orjson.dumps(findings).decode())
    else:
        table = Table("check", "", "finding", "what to do")
        for finding in findings:
            shown = f"[{_COLOUR[finding.state]}]{finding.state}[/]"
            table.add_row(finding.check, shown, escape(finding.finding), escape(finding.advice))
        Console().print(table)
    if any(finding.state == "fail" for finding in findings):
        raise typer.Exit(1)
