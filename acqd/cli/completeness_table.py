"""The tables of `acqd sink completeness`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from acqd.cli.folded_table import Table
from acqd.cli.terminal import terminal

if TYPE_CHECKING:
    from acqd.storage.completeness import Completeness
    from acqd.storage.gaps import Gap

_MOST_GAPS = 40


def show_completeness(report: list[Completeness], day: str) -> None:
    """Print a line per channel, then the gaps."""
    console = terminal(tables=True)
    if not report:
        console.print(f"the database has no rows of {day} or before")
        return
    table = Table(title=f"{day} (UTC)", title_justify="left")
    for name in ("device", "channel"):
        table.add_column(name)
    for name in ("expected", "stored", "missing", "complete", "gaps"):
        table.add_column(name, justify="right")
    for one in report:
        share = _share(one.stored, one.expected)
        known = str(len(one.gaps)) if one.source == "rows" else "past retention"
        table.add_row(one.device, one.channel, str(one.expected), str(one.stored), str(one.missing), share, known)
    console.print(table)
    gaps = _by_gap(report)
    if not gaps:
        return
    table = Table("device", "channels", "from (UTC)", "to", "rows", "cause")
    having = {name: [one.channel for one in report if one.device == name] for name in {one.device for one in report}}
    for (device, gap), channels in list(gaps.items())[:_MOST_GAPS]:
        which = "all" if len(channels) > 1 and channels == having[device] else " ".join(channels)  # fits 80 columns
        table.add_row(device, which, _of_day(gap.begin, day), _of_day(gap.end, day), str(gap.rows), gap.cause.value)
    console.print(table)
    if len(gaps) > _MOST_GAPS:
        console.print(f"{len(gaps) - _MOST_GAPS} more gaps: --json lists all")


def _share(stored: int, expected: int) -> str:
    """Share of the rows in %, cut to two digits: it says 100 only where no row is missing."""
    return f"{10_000 * stored // expected / 100:.2f} %" if expected else "-"


def _by_gap(report: list[Completeness]) -> dict[tuple[str, Gap], list[str]]:
    """Channels that have the same gap, by device and gap, in the order of time."""
    channels: dict[tuple[str, Gap], list[str]] = {}
    for one in report:
        for gap in one.gaps:
            channels.setdefault((one.device, gap), []).append(one.channel)
    return dict(sorted(channels.items(), key=lambda entry: (entry[0][0], entry[0][1].begin)))


def _of_day(stamp: str, day: str) -> str:
    """Time of the day, of an RFC 3339 stamp."""
    return stamp[11:].rstrip("Z") if stamp.startswith(day) else "24:00:00.000"
