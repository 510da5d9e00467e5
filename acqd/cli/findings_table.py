"""The table of what was checked: state, finding, advice."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from rich.markup import escape

from acqd.cli.folded_table import Table

if TYPE_CHECKING:
    from acqd.daemon.finding import Finding

_COLOUR = {"ok": "green", "warn": "yellow", "fail": "red"}


def findings_table(findings: Iterable[Finding]) -> Table:
    """A row for each finding; long ones are folded, never cut."""
    table = Table("check", "")
    for name in ("finding", "what to do"):
        table.add_column(name)  # a port or a path is never cut
    for finding in findings:
        state = f"[{_COLOUR[finding.state]}]{finding.state}[/]"
        table.add_row(finding.check, state, escape(finding.finding), escape(finding.advice))
    return table
