"""From where budgets stand to alarms: one a period when it will be exceeded, and once more when it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from acqd.energy.budget import Standing
from acqd.integrations.alarms.book import Book, Notification

KIND = "budget-"
_CLEARLY = 0.95
"""An alarm of a forecast ends below this share of the limit: a forecast wavers."""
_BLIND_S = 3600.0
"""A budget of which nothing is known for so long is an alarm: somebody relies on it."""


class BudgetAlarms:
    """Raises and resolves the alarms of budgets."""

    def __init__(self, book: Book) -> None:
        self._book = book
        self._blind: dict[str, int] = {}
        """Since when nothing is known of a budget, ns UTC."""

    def take(self, standings: Sequence[Standing], now_ns: int) -> Iterator[Notification]:
        """Where all budgets stand now."""
        for standing in standings:
            yield from self._one(standing, now_ns)
        # a budget that is not in the configuration any more
        keys = {key_of(standing) for standing in standings}
        for key in [key for key in self._book.active if f"/{KIND}" in key and key not in keys]:
            yield from self._book.resolve(key)

    def _one(self, standing: Standing, now_ns: int) -> Iterator[Notification]:
        key, active = key_of(standing), self._book.active.get(key_of(standing))
        if standing.state == "unknown":
            since = self._blind.setdefault(key, now_ns)
            if active is None and now_ns - since >= _BLIND_S * 1e9:
                yield from self._book.raise_(key, standing.text, now_ns, "unknown")
            return
        self._blind.pop(key, None)
        identity = f"{standing.begin}/{standing.state}"
        before = "" if active is None else active.identity
        if before == f"{standing.begin}/exceeded" and standing.state != "exceeded":
            return  # exported since; the period is over before the alarm is
        if standing.state in ("exceeded", "forecast"):
            details = {"used": standing.used, "forecast": standing.forecast, "unit": standing.budget.unit,
                       "limit": standing.budget.limit, "per": standing.budget.per}  # fmt: skip
            yield from self._book.raise_(key, standing.text, now_ns, identity, details)
            return
        wavering = standing.forecast is not None and standing.forecast > _CLEARLY * standing.budget.limit
        if not (wavering and before == f"{standing.begin}/forecast"):
            yield from self._book.resolve(key)


def key_of(standing: Standing) -> str:
    """DEVICE/budget-day-kWh; `all` for all devices together."""
    budget = standing.budget
    return f"{budget.device or 'all'}/{KIND}{budget.per}-{budget.unit}"
