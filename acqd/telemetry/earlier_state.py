"""Whether the database of a sink has gone back to an earlier state without the sink's knowledge (ADR 97).

A computer that is put back as a whole, from a snapshot or the image of a card, has forgotten with its database what it
knew of that. Receipts say from which commit of which run a database went on: those who have heard of a later one know.
"""

from __future__ import annotations

from msgspec import UNSET

from acqd.telemetry.receipts import Commits, Receipt

_MOST = 64
"""Databases, and runs of each, that are remembered: a stranger may write receipts, too."""


class CommitsHeard:
    """What receipts have said since the start of this daemon."""

    def __init__(self) -> None:
        self._runs: dict[tuple[str, str], dict[str, Commits]] = {}
        """By sink and database: each run with its last receipt, the newest run last."""

    def gone_back(self, receipt: Receipt) -> bool:
        """Whether this receipt is the first of a run whose database lacks commits of which another run's have told."""
        said = receipt.commits
        if said is UNSET:
            return False  # of an earlier version
        database = receipt.sink, said.database
        runs = self._runs.pop(database, {})
        self._runs[database] = runs
        if len(self._runs) > _MOST:
            del self._runs[next(iter(self._runs))]
        back = said.run not in runs and bool(runs) and _lacks(said, runs)
        runs[said.run] = said
        if len(runs) > _MOST:
            del runs[next(iter(runs))]
        return back


def _lacks(said: Commits, runs: dict[str, Commits]) -> bool:
    """Whether a new run went on from before the end of the newest run that was heard."""
    newest = next(reversed(runs.values()))
    if said.after in runs and said.after != newest.run:
        return True  # it leaves out what came later, whatever the numbers are
    return said.begun < newest.now  # a run in between may have written for other devices only
