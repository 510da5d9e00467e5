"""The tables of `acqd sink completeness`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from acqd.cli.terminal import terminal

if TYPE_CHECKING:
    from acqd.storage.completeness import Completeness

_MOST_GAPS = 40


def show_completeness(report: list[Completeness], day: str) -> None:
    """Print a line per channel, then the gaps."""
    console = terminal(soft_wrap=False)
    if not report:
        console.print(f"the database has no rows of {day} or before")
        return
    table = Table(title=f"{day} (UTC)", title_justify="left")
    for name in ("device", "channel"):
        table.add_column(name)
    for name in ("expected", "stored", "missing", "complete", "gaps"):
        table.add_column(name, justify="right")
    for one in report:
        share = f"{100 * one.stored / one.expected:.4f} %" if one.expected else "-"
        known = str(len(one.gaps)) if one.source == "rows" else "past retention"
        table.add_row(one.device, one.channel, str(one.expected), str(one.stored), str(one.missing), share, known)
    console.print(table)
    gaps = [(one, gap) for one in report for gap in one.gaps]
    if not gaps:
        return
    table = Table("device", "channel", "from", "to", "rows", "cause")
    for one, gap in gaps[:_MOST_GAPS]:
        table.add_row(one.device, one.channel, gap.begin, gap.end, str(gap.rows), gap.cause.value)
    console.print(table)
    if len(gaps) > _MOST_GAPS:
        console.print(f"{len(gaps) - _MOST_GAPS} more gaps: --json lists all")
