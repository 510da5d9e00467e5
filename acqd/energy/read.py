"""Reads a device's registers from SQL and makes its account."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, tzinfo
from itertools import chain

import numpy as np
import sqlalchemy as sa

from acqd.energy.account import Account, account_of
from acqd.energy.stretches import stretches_of
from acqd.energy.tariff import Tariff
from acqd.errors import InputError, UserError
from acqd.storage import buckets as stored
from acqd.storage import known_rows
from acqd.storage.buckets import Buckets, Kept

_MINUTE_S, _QUARTER_S = 60, 900
_MINUTES_UP_TO_S = 10 * 86_400
"""Up to here minutes are read: standby and gaps are finer. A year of minutes would take seconds."""
_LOOK_BACK_S = 400 * 86_400


class NoRowsError(UserError):
    """A device has no rows in a period."""

    def __init__(self, what: str, remedy: str = "") -> None:
        """`remedy`: for somebody who has chosen the period."""
        super().__init__(f"{what}; {remedy}" if remedy else what)
        self.what = what


def devices(engine: sa.Engine) -> list[str]:
    """All devices with rows or roll-ups."""
    with engine.connect() as connection:
        return sorted({*stored.devices(connection), *known_rows.devices(connection)})


def has_rows(engine: sa.Engine, device: str, begin: int, end: int) -> bool:
    """Whether a device has rows or roll-ups between two Unix times [s]."""
    with engine.connect() as connection:
        return bool(stored.channels(connection, device, begin, end))


def is_simulated(engine: sa.Engine, device: str) -> bool:
    """Whether the newest row of a device is simulated."""
    with engine.connect() as connection:
        return stored.newest_has_flag(connection, device, "simulated")


def stored_span(engine: sa.Engine, device: str) -> tuple[int, int] | None:
    """Unix times [s] of the first and the last row or roll-up of a device; None without any."""
    with engine.connect() as connection:
        return stored.stored_span(connection, device)


def span_text(connection: sa.Connection, device: str, zone: tzinfo = UTC) -> str:
    """From when to when rows or roll-ups of a device are stored, in words."""
    span = stored.stored_span(connection, device)
    return "at no time" if span is None else _from_to(*span, zone)


def _from_to(begin: int, end: int, zone: tzinfo) -> str:
    first, last = (datetime.fromtimestamp(each, zone).strftime("%Y-%m-%d %H:%M") for each in (begin, end))
    return f"from {first} to {last} ({zone})"


def read_account(
    engine: sa.Engine, device: str, boundaries: Sequence[int], tariff: Tariff | None, months: Sequence[int] = ()
) -> Account:
    """The account of a device between Unix times [s], whole minutes. Raises UserError where it has no rows.

    `months`: Unix times [s] between which demands of months are wanted.
    """
    with engine.connect() as connection:
        readings = _Readings(connection, device, boundaries[0], boundaries[-1], resolution(boundaries, tariff))
        return readings.account(boundaries, tariff, months)


def read_accounts(
    engine: sa.Engine, device: str, spans: Sequence[Sequence[int]], tariff: Tariff | None, kept: Kept | None = None,
    seconds: int | None = None,
) -> list[Account]:  # fmt: skip
    """Accounts between several boundaries, Unix times [s], from one reading of buckets of 60 or 900 `seconds`.

    Each is priced by itself: where a series lacks a price for some of its time, it has no cost, and `trouble` says why.
    Raises UserError where the device has no rows.
    """
    begin, end = min(span[0] for span in spans), max(span[-1] for span in spans)
    with engine.connect() as connection:
        readings = _Readings(
            connection, device, begin, end, seconds or resolution([begin, *chain(*spans), end], tariff), kept
        )
        return [readings.priced(span, tariff) for span in spans]


class _Readings:
    """The buckets of a device, read once."""

    def __init__(
        self, connection: sa.Connection, device: str, begin: int, end: int, seconds: int, kept: Kept | None = None
    ) -> None:
        first, last = begin // seconds * seconds, -(-end // seconds) * seconds
        self._connection, self._device = connection, device
        self._channel = channel = channel_of(connection, device, begin, end)
        self._buckets, _ = stored.read_buckets(connection, device, channel, seconds, first, last, kept)
        interval = stored.row_interval(connection, device, channel, max(begin - _LOOK_BACK_S, 0), end)
        self._interval = interval or _usual_interval(self._buckets)
        self._seconds = seconds
        self._simulated = stored.has_flag(connection, device, channel, begin, end, "simulated")

    def account(self, boundaries: Sequence[int], tariff: Tariff | None, months: Sequence[int] = ()) -> Account:
        """Periods between boundaries within what was read."""
        buckets, before = self._between(boundaries[0], boundaries[-1])
        stretches = stretches_of(buckets, self._interval, boundaries, self._first_reading)
        account = account_of(
            self._device, self._channel, buckets, before, stretches, self._interval, boundaries, tariff, months
        )
        return replace(account, remarks=_remarks(account, buckets, self._interval), simulated=self._simulated)

    def priced(self, boundaries: Sequence[int], tariff: Tariff | None) -> Account:
        """Without costs where a price is unknown: a series that has ended says nothing about the energy."""
        try:
            return self.account(boundaries, tariff)
        except InputError as error:
            return replace(self.account(boundaries, None), trouble=str(error))

    def _between(self, begin: int, end: int) -> tuple[Buckets, int]:
        """Buckets between two Unix times [s] and the newest before with a reading, and how many lie before: 0 or 1."""
        start, seconds = self._buckets.start, self._seconds
        first, last = np.searchsorted(start, [begin // seconds * seconds, end]).tolist()
        before = next((k for k in range(first - 1, -1, -1) if self._buckets.W[k] is not None), None)
        chosen = [*([] if before is None else [before]), *range(first, last)]
        return self._buckets.chosen(chosen), int(before is not None)

    def _first_reading(self, since: int, until: int) -> float | None:
        return stored.first_reading(self._connection, self._device, self._channel, since, until)


def resolution(boundaries: Sequence[int], tariff: Tariff | None) -> int:
    """Seconds of the buckets that these periods need."""
    by_quarters = all(at % _QUARTER_S == 0 for at in boundaries) and not (tariff and tariff.by_minute)
    if by_quarters and boundaries[-1] - boundaries[0] > _MINUTES_UP_TO_S:
        return _QUARTER_S
    return _MINUTE_S


def channel_of(connection: sa.Connection, device: str, begin: int, end: int) -> str:
    """The total where there is one, else the only channel. Raises NoRowsError, or UserError for several."""
    channels = stored.channels(connection, device, begin, end)
    if "total" in channels:
        return "total"
    if not channels and stored.stored_span(connection, device) is None:
        raise NoRowsError(f"device {device!r} has no rows in this database at all")
    if not channels:
        raise NoRowsError(
            f"device {device!r} has no rows {_from_to(begin, end, UTC)}, only {span_text(connection, device)}",
            "choose another --from and --to",
        )
    if len(channels) > 1:
        raise UserError(f"device {device!r} has the channels {', '.join(sorted(channels))} but no total")
    return next(iter(channels))


def _usual_interval(buckets: Buckets) -> float:
    """Time from row to row [s] by the usual number of rows; 40 ms where even that is unknown."""
    return float(np.median(buckets.seconds / buckets.rows)) if len(buckets.rows) else 0.04


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _remarks(account: Account, buckets: Buckets, interval_s: float) -> list[str]:
    twice = int((buckets.rows * interval_s > 1.5 * buckets.seconds).sum())
    return list(chain(
        [f"{twice} buckets hold twice the rows of their time: two daemons under one name (flag two_boots), or another "
         "interval than today's"] if twice else [],
        [f"the register was exchanged or set {_times(len(account.jumps))}; those steps are no energy"]
        if account.jumps else [],
        ["rest and work cannot be told apart by power, so the standby share is unknown"]
        if account.standby is None and account.total.nWh is not None else [],
    ))  # fmt: skip
