"""The statement of several devices over a range of local time, compared with the range before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, time
from zoneinfo import ZoneInfo

import sqlalchemy as sa

from acqd.energy.account import Account, Period, sum_of
from acqd.energy.comparison import Comparison, compare
from acqd.energy.periods import Range, Split, boundaries, label
from acqd.energy.read import devices, read_account, span_text
from acqd.energy.tariff import QUARTER_S, Tariff
from acqd.errors import InputError, UserError

_NAMED = 3
"""Devices in a message."""


@dataclass(frozen=True, slots=True)
class Statement:
    """What `acqd energy` prints."""

    chosen: Range
    by: Split
    zone: ZoneInfo
    tariff: Tariff | None
    accounts: list[Account]
    periods: list[Period]
    """Of all devices together."""
    total: Period
    before: Comparison | str
    """The comparison, or why there can be no comparison."""

    def label(self, period: Period) -> str:
        """A period in the words of a calendar."""
        return label(period.begin, self.by, self.zone)

    @property
    def capacity_EUR(self) -> float | None:  # noqa: N802
        """The capacity price of the highest quarter hour, of all devices by themselves; per month, of all its months.

        None where the range, or one of its months, has no complete quarter hour.
        """
        if self.tariff is None or self.tariff.capacity_price is None:
            return None
        by_month = self.tariff.capacity_per == "month"
        demands = [one for account in self.accounts for one in (account.months if by_month else [account.total.demand])]
        if None in demands:
            return None
        return float(self.tariff.capacity_price) * sum(one.W for one in demands if one is not None) / 1000

    @property
    def capacity_text(self) -> str:
        """What `capacity_EUR` is for."""
        months = len(self.accounts[0].months)
        if self.tariff is not None and self.tariff.capacity_per == "month":
            return f"for the highest quarter hour of {'the month' if months == 1 else f'each of {months} months'}"
        return "a year, at this maximum"


def statement_of(
    engine: sa.Engine, wanted: Sequence[str], chosen: Range, earlier: Range, by: Split, zone: ZoneInfo,
    shifts: Sequence[time], tariff: Tariff | None,
) -> Statement:  # fmt: skip
    """Read the devices `wanted` (all, if empty). Raises UserError where one has no rows in the range."""
    cuts = boundaries(chosen, by, zone, shifts)
    names = _known(engine, wanted, chosen)
    months = boundaries(chosen, "month", zone)
    accounts = [read_account(engine, name, cuts, tariff, months) for name in names]
    if not accounts:
        begin, end = (
            datetime.fromtimestamp(each, zone).strftime("%Y-%m-%d %H:%M") for each in (chosen.begin, chosen.end)
        )
        running = Range(chosen.end, chosen.end + QUARTER_S)  # the range ends before it, unless a person says more
        remedy = "choose another period by --from and --to, or --last"
        if any(_has_rows(engine, name, running) for name in devices(engine)):
            after = datetime.fromtimestamp(running.end, zone)
            remedy = f"--to {after:%Y-%m-%dT%H:%M} includes the quarter hour that follows"
        raise UserError(f"no device has rows from {begin} to {end}, only {_stored(engine, zone)}: {remedy}")
    periods = [sum_of(together) for together in zip(*(account.periods for account in accounts), strict=True)]
    total = sum_of([account.total for account in accounts]) if len(accounts) > 1 else accounts[0].total
    if len(accounts) == 1:
        periods = accounts[0].periods
    return Statement(
        chosen, by, zone, tariff, accounts, periods, total,
        _compare(engine, [account.device for account in accounts], total, earlier),
    )  # fmt: skip


def _known(engine: sa.Engine, wanted: Sequence[str], chosen: Range) -> list[str]:
    known = devices(engine)
    if not known:
        raise UserError("the database has no rows of power; `acqd sink` stores them")
    for name in wanted:
        if name not in known:
            raise UserError(f"--device {name!r}: the database has {', '.join(known)}")
    if wanted:
        return list(dict.fromkeys(wanted))
    return [name for name in known if _has_rows(engine, name, chosen)]


def _stored(engine: sa.Engine, zone: ZoneInfo) -> str:
    """Which times of which devices are stored, of three devices at most."""
    names = devices(engine)
    with engine.connect() as connection:
        spans = [f"{name} {span_text(connection, name, zone)}" for name in names[:_NAMED]]
    return ", ".join(spans) + (f" and {len(names) - _NAMED} other devices" if len(names) > _NAMED else "")


def _has_rows(engine: sa.Engine, device: str, chosen: Range) -> bool:
    from acqd.storage.buckets import channels

    with engine.connect() as connection:
        return bool(channels(connection, device, chosen.begin, chosen.end))


def _compare(engine: sa.Engine, names: Sequence[str], total: Period, earlier: Range) -> Comparison | str:
    try:
        cuts = [earlier.begin, earlier.end]
        before = sum_of([read_account(engine, name, cuts, None).total for name in names])
    except InputError:
        raise
    except UserError:
        return "no rows of the period before"
    return compare(total, before)
