"""Reads a device's registers from SQL and makes its account."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
import sqlalchemy as sa

from acqd.energy.account import Account, account_of
from acqd.energy.stretches import stretches_of
from acqd.energy.tariff import Tariff
from acqd.errors import UserError
from acqd.storage import buckets as stored
from acqd.storage import known_rows
from acqd.storage.buckets import Buckets

_MINUTE_S, _QUARTER_S = 60, 900
_MINUTES_UP_TO_S = 10 * 86_400
"""Up to here minutes are read: standby and gaps are finer. A year of minutes would take seconds."""
_LOOK_BACK_S = 400 * 86_400


def devices(engine: sa.Engine) -> list[str]:
    """All devices with rows or roll-ups."""
    with engine.connect() as connection:
        return sorted({*stored.devices(connection), *known_rows.devices(connection)})


def read_account(
    engine: sa.Engine, device: str, boundaries: Sequence[int], tariff: Tariff | None, months: Sequence[int] = ()
) -> Account:
    """The account of a device between Unix times [s], whole minutes. Raises UserError where it has no rows.

    `months`: Unix times [s] between which demands of months are wanted.
    """
    begin, end = boundaries[0], boundaries[-1]
    seconds = resolution(boundaries, tariff)
    first, last = begin // seconds * seconds, -(-end // seconds) * seconds
    with engine.connect() as connection:
        channel = _channel(device, stored.channels(connection, device, begin, end))
        buckets, before = stored.read_buckets(connection, device, channel, seconds, first, last)
        interval = stored.row_interval(connection, device, channel, max(begin - _LOOK_BACK_S, 0), end)
        interval = interval or _usual_interval(buckets)

        def first_reading(since: int, until: int) -> float | None:
            return stored.first_reading(connection, device, channel, since, until)

        stretches = stretches_of(buckets, interval, boundaries, first_reading)
        account = account_of(device, channel, buckets, before, stretches, interval, boundaries, tariff, months)
        simulated = stored.has_flag(connection, device, channel, begin, end, "simulated")
    return replace(account, remarks=_remarks(account, buckets, interval), simulated=simulated)


def resolution(boundaries: Sequence[int], tariff: Tariff | None) -> int:
    """Seconds of the buckets that these periods need."""
    by_quarters = all(at % _QUARTER_S == 0 for at in boundaries) and not (tariff and tariff.by_minute)
    if by_quarters and boundaries[-1] - boundaries[0] > _MINUTES_UP_TO_S:
        return _QUARTER_S
    return _MINUTE_S


def _channel(device: str, channels: set[str]) -> str:
    """The total where there is one, else the only channel. Raises UserError."""
    if "total" in channels:
        return "total"
    if not channels:
        raise UserError(f"device {device!r} has no rows in this period; `acqd energy` needs another --from, --to")
    if len(channels) > 1:
        raise UserError(f"device {device!r} has the channels {', '.join(sorted(channels))} but no total")
    return next(iter(channels))


def _usual_interval(buckets: Buckets) -> float:
    """Time from row to row [s] by the usual number of rows; 40 ms where even that is unknown."""
    return float(np.median(buckets.seconds / buckets.rows)) if len(buckets.rows) else 0.04


def _remarks(account: Account, buckets: Buckets, interval_s: float) -> list[str]:
    twice = int((buckets.rows * interval_s > 1.5 * buckets.seconds).sum())
    return list(chain(
        [f"{twice} buckets hold twice the rows of their time: two daemons under one name (flag two_boots), or another "
         "interval than today's"] if twice else [],
        [f"the register was exchanged or set {len(account.jumps)} times; those steps are no energy"]
        if account.jumps else [],
        ["rest and work cannot be told apart by power, so the standby share is unknown"]
        if account.standby is None and account.total.nWh is not None else [],
    ))  # fmt: skip
