"""The rows of a period, as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
import sqlalchemy as sa

from acqd.arrays import Floats
from acqd.en50160.limits import EVENT_FLAGS, INCOMPLETE_FLAGS
from acqd.errors import UserError
from acqd.storage.schema import power_event, power_quality
from acqd.timestamps import filetime

ORDERS = 50


@dataclass(frozen=True, slots=True)
class Series:
    """Values of one channel and aggregation in the order of time."""

    seconds: Floats
    """[n] s since the begin of the period."""
    values: Floats
    """[n] or [n, 50]; NaN for unknown."""
    event: np.ndarray
    """[n] flagged with an event."""
    incomplete: np.ndarray
    """[n] not of a whole interval."""

    @property
    def usable(self) -> np.ndarray:
        """Values that statistics are made of."""
        known = np.isfinite(self.values) if self.values.ndim == 1 else np.isfinite(self.values[:, 0])
        return np.asarray(known & ~self.event & ~self.incomplete)


@dataclass(frozen=True, slots=True)
class Period:
    """What is stored of a device in a period."""

    device: str
    begin: datetime
    end: datetime
    channels: list[str]
    """Phases."""
    rows: list[Mapping[str, Any]]
    events: list[Mapping[str, Any]]
    simulated: bool

    def series(self, aggregation: str, name: str, channel: str) -> Series:
        """One quantity."""
        rows = [one for one in self.rows if (one["aggregation"], one["channel"]) == (aggregation, channel)]
        values = [one[name] for one in rows]
        if name.endswith("_h"):
            values = [one if one is not None else [None] * ORDERS for one in values]
        begin = filetime(round(self.begin.timestamp()) * 10**9)
        flags = [frozenset(one["flags"]) for one in rows]
        return Series(
            np.array([(one["filetime"] - begin) * 1e-7 for one in rows]),
            np.array(values, dtype=np.float64),
            np.array([bool(one & EVENT_FLAGS) for one in flags], dtype=bool),
            np.array([bool(one & INCOMPLETE_FLAGS) for one in flags], dtype=bool),
        )


def devices(engine: sa.Engine) -> list[str]:
    """Devices with 10 min values."""
    chosen = sa.select(power_quality.c.device).where(power_quality.c.aggregation == "10min").distinct()
    with engine.connect() as connection:
        return sorted(connection.execute(chosen).scalars())


def read_period(engine: sa.Engine, device: str, begin: datetime, end: datetime) -> Period:
    """The rows of `device` from `begin` to `end`. Raises UserError where there are none."""
    ticks = [filetime(round(moment.timestamp()) * 10**9) for moment in (begin, end)]
    columns = [power_quality.c[name] for name in _NAMES]
    chosen = sa.select(*columns).where(*_within(power_quality, device, ticks))
    chosen = chosen.where(power_quality.c.aggregation.in_(("10min", "10s", "Plt"))).order_by(power_quality.c.filetime)
    events = sa.select(power_event).where(*_within(power_event, device, ticks)).order_by(power_event.c.filetime)
    with engine.connect() as connection:
        rows: list[Mapping[str, Any]] = [dict(row) for row in connection.execute(chosen).mappings()]
        found: list[Mapping[str, Any]] = [dict(row) for row in connection.execute(events).mappings()]
    if not any(row["aggregation"] == "10min" for row in rows):
        raise UserError(
            f"{device}: no 10 min values of power quality from {begin:%Y-%m-%d %H:%M} to {end:%Y-%m-%d %H:%M} UTC; "
            "they need [quality] enabled = true, and two ticks of ten minutes"
        )
    channels = sorted({row["channel"] for row in rows if row["aggregation"] == "10min"} - {"total"})
    simulated = any("simulated" in row["flags"] for row in rows)
    return Period(device, begin, end, channels, rows, found, simulated)


def _within(table: sa.Table, device: str, ticks: Sequence[int]) -> list[sa.ColumnElement[bool]]:
    return [table.c.device == device, table.c.filetime >= ticks[0], table.c.filetime < ticks[1]]


_NAMES = ("channel", "aggregation", "filetime", "flags", "f", "Vrms", "V_h", "V_thds", "V_u2", "Plt")
