"""Whether the database of a sink has gone back to an earlier state without the sink's knowledge (ADR 97).

A computer that is put back as a whole, from a snapshot or the image of a card, has forgotten with its database what it
knew of that. Receipts say how many commits the database had when the sink was started: fewer than an earlier receipt
has said.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from msgspec import UNSET

from acqd.telemetry.receipts import Receipt

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")
_MOST = 64
"""Sinks, and earlier states, that are remembered: a stranger may write receipts, too."""


class CommitsHeard:
    """What receipts have said since the start of this daemon."""

    def __init__(self, keep_s: float, now: Callable[[], float]) -> None:
        """`keep_s`: how long delivered rows are kept. The same state is no news for so long.

        Two sinks of one name, each with a database, show their states by turns.
        """
        self._keep_s, self._now = keep_s, now
        self._commits: dict[str, tuple[int, int]] = {}
        self._known: dict[tuple[str, int], float] = {}

    def gone_back(self, receipt: Receipt) -> bool:
        """Whether this receipt is the first to show that the database of its sink is in an earlier state."""
        if receipt.begun is UNSET or receipt.commits is UNSET:
            return False  # of an earlier version
        begun, before = self._commits.pop(receipt.sink, (receipt.begun, receipt.commits))
        self._commits[receipt.sink] = receipt.begun, receipt.commits
        _forget(self._commits)
        if receipt.begun == begun or receipt.begun >= before:
            return False
        state, now = (receipt.sink, receipt.begun), self._now()
        known = now - self._known.get(state, -1e9) < self._keep_s
        if not known:
            self._known[state] = now
            _forget(self._known)
        return not known


def _forget(known: dict[_Key, _Value]) -> None:
    while len(known) > _MOST:
        del known[next(iter(known))]
