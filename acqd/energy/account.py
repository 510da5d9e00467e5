"""Periods with their energy, power, cost and CO2, from stretches of the register."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise

import numpy as np

from acqd.arrays import Floats
from acqd.energy.standby import Standby, standby_of
from acqd.energy.stretches import NWH_PER_KWH, Kind, Stretches, known_seconds
from acqd.energy.tariff import QUARTER_S, Tariff
from acqd.storage.buckets import Buckets

_WHOLE = 0.999
"""Least share of its rows that a quarter hour needs for a demand (docs/rows.md)."""


@dataclass(frozen=True, slots=True)
class Demand:
    """The highest mean power of a quarter hour."""

    W: float
    start: int
    """Unix s."""
    incomplete: int
    """Quarter hours that lack rows, and so have no demand."""


@dataclass(frozen=True, slots=True)
class Period:
    """One period of one device, or the sum of several devices."""

    begin: int
    """Unix s."""
    end: int
    nWh: int | None
    """1e-12 kWh; None: no reading at all."""
    known_s: float
    """Seconds with rows."""
    mean_W: float | None
    """Of the rows."""
    max_W: float | None
    """Largest row."""
    demand: Demand | None
    cost: Fraction | None
    """EUR of what has a price; None without a tariff or without energy."""
    unpriced_nWh: int
    """Energy over a change of the price where rows lack."""
    co2_kg: Fraction | None
    """Kg of what has a factor; None without one or without energy."""
    no_co2_nWh: int
    """Energy over a change of the factor where rows lack."""
    standby_nWh: int | None

    @property
    def missing_s(self) -> float:
        """Seconds without rows."""
        return max(self.end - self.begin - self.known_s, 0.0)

    @property
    def kWh(self) -> float | None:  # noqa: N802
        """Energy."""
        return None if self.nWh is None else self.nWh / NWH_PER_KWH


@dataclass(frozen=True, slots=True)
class Account:
    """A device's periods, and what belongs to none of them."""

    device: str
    channel: str
    periods: list[Period]
    total: Period
    between_nWh: int
    """Energy over boundaries where rows lack."""
    jumps_nWh: int
    """Steps of the register that are no energy."""
    jumps: list[int]
    """Unix s of their ends."""
    register_nWh: int
    """Last reading minus the first: the periods, `between_nWh` and `jumps_nWh` together."""
    standby: Standby | None
    months: list[Demand | None]
    """The highest quarter hour of every month of local time in the range; None where none is complete."""
    remarks: list[str] = field(default_factory=list)
    simulated: bool = False
    """By the flag of the newest row; False where no rows are kept."""
    trouble: str = ""
    """Why there are no costs although there is a tariff."""


def account_of(
    device: str, channel: str, buckets: Buckets, skipped: int, stretches: Stretches, interval_s: float,
    boundaries: Sequence[int], tariff: Tariff | None, months: Sequence[int],
) -> Account:  # fmt: skip
    """Sort stretches into periods; the first `skipped` buckets lie before them. `months`: boundaries of months."""
    of_periods = buckets.chosen(range(skipped, len(buckets.start)))
    standby = standby_of(of_periods)
    priced = _Priced(stretches, tariff, boundaries[0])
    place = np.searchsorted(boundaries, stretches.start, side="right") - 1
    known = (stretches.kind == Kind.KNOWN) & (place >= 0) & (place < len(boundaries) - 1)
    sums = _Sums(of_periods, stretches, interval_s, priced, standby)
    spans = list(pairwise(boundaries))
    periods = [sums.period(begin, end, known & (place == k)) for k, (begin, end) in enumerate(spans)]
    total = sums.period(boundaries[0], boundaries[-1], known)
    between, stepped = (int(stretches.nWh[stretches.kind == kind].sum()) for kind in (Kind.GAP, Kind.JUMP))
    jumps = stretches.end[stretches.kind == Kind.JUMP].tolist()
    demands = [sums.demand(begin, end) for begin, end in pairwise(months)]
    return Account(device, channel, periods, total, between, stepped, jumps, stretches.register_nWh, standby, demands)


def sum_of(periods: Sequence[Period]) -> Period:
    """The same period of several devices; powers of devices have no common maximum. Raises ValueError for none.

    Where some devices have a cost, the energy of those without one has no price: the sum is a lower bound. So with CO2.
    """
    energies = [one.nWh for one in periods]
    costs, co2 = [one.cost for one in periods], [one.co2_kg for one in periods]
    means = [one.mean_W for one in periods if one.mean_W is not None]
    standby = [one.standby_nWh for one in periods]
    return Period(
        periods[0].begin, periods[0].end,
        sum(energy for energy in energies if energy is not None) if any(e is not None for e in energies) else None,
        min(one.known_s for one in periods), sum(means) if means else None, None, None,
        _sum(costs), sum(one.unpriced_nWh for one in periods) + _without(periods, costs), _sum(co2),
        sum(one.no_co2_nWh for one in periods) + _without(periods, co2),
        None if None in standby else sum(one for one in standby if one is not None),
    )  # fmt: skip


def _without(periods: Sequence[Period], values: Sequence[Fraction | None]) -> int:
    """nWh of devices without a value, where others have one."""
    if all(value is None for value in values):
        return 0
    return sum(one.nWh or 0 for one, value in zip(periods, values, strict=True) if value is None)


def _sum(values: Sequence[Fraction | None]) -> Fraction | None:
    known = [value for value in values if value is not None]
    return sum(known, Fraction(0)) if known else None


class _Priced:
    """Cost and CO2 of stretches; import and export of a quarter hour are netted, as the register nets them."""

    def __init__(self, stretches: Stretches, tariff: Tariff | None, since: int) -> None:
        self._stretches, self._since = stretches, since
        within = (stretches.kind == Kind.KNOWN) & (stretches.start >= since)
        moments = stretches.start[within]
        prices = None if tariff is None or not len(moments) else tariff.prices(moments)
        factors = None if tariff is None or not len(moments) else tariff.emissions(moments)
        energies = stretches.nWh[within].tolist()
        self._place = np.flatnonzero(within)
        self.cost: dict[int, int] | None = None
        self.co2: dict[int, int] | None = None
        self.cost_unit = self.co2_unit = Fraction(1)
        """What `cost` counts [EUR] and `co2` [kg]: integers add up faster than fractions, and as exactly."""
        self.unpriced: set[int] = set()
        self.no_co2: set[int] = set()
        imports = self._imports()
        if prices is not None and tariff is not None:
            self.unpriced = self._over_a_change(tariff.prices, tariff.resolution)
            scale = _common_denominator([*prices, tariff.feed_in])
            self.cost_unit = Fraction(1, scale * NWH_PER_KWH)
            self.cost = {
                k: e * _scaled(price if taken else tariff.feed_in, scale)
                for k, e, price, taken in zip(self._place.tolist(), energies, prices, imports, strict=True)
                if k not in self.unpriced
            }
        if factors is not None and tariff is not None:
            self.no_co2 = self._over_a_change(tariff.emissions, tariff.resolution)
            scale = _common_denominator(factors)
            self.co2_unit = Fraction(1, scale * NWH_PER_KWH)
            self.co2 = {
                k: e * _scaled(factor, scale) if taken else 0
                for k, e, factor, taken in zip(self._place.tolist(), energies, factors, imports, strict=True)
                if k not in self.no_co2
            }

    def _imports(self) -> list[bool]:
        """Whether the quarter hour of each stretch imports more than it exports; over a gap, the stretch itself."""
        of, place = self._stretches, self._place
        energy, quarter = of.nWh[place], of.start[place] // QUARTER_S
        over_a_gap = of.begin[place] < of.start[place]
        _, group = np.unique(np.where(over_a_gap, -1 - np.arange(len(place)), quarter), return_inverse=True)
        net = np.zeros(group.max(initial=-1) + 1, dtype=energy.dtype)
        np.add.at(net, group, energy)
        return (net[group] >= 0).tolist()  # type: ignore[no-any-return]

    def _over_a_change(self, values: Values, step_s: int) -> set[int]:
        """Stretches over a gap in which prices or factors change, of `values` that hold for whole steps."""
        of = self._stretches
        over = [k for k in self._place.tolist() if of.begin[k] < of.start[k]]
        changed = set()
        for k in over:
            begin = max(int(of.begin[k]), self._since)
            moments = np.arange(begin // step_s * step_s, int(of.start[k]) + 1, step_s)
            moments[0] = begin
            if len(set(values(moments) or [])) > 1:
                changed.add(k)
        return changed


Values = Callable[[np.ndarray], list[Fraction] | None]
"""Prices or factors at Unix times [s]."""


def _common_denominator(values: Sequence[Fraction]) -> int:
    return math.lcm(*{value.denominator for value in values})


def _scaled(value: Fraction, scale: int) -> int:
    return value.numerator * (scale // value.denominator)


class _Sums:
    """Sums and extremes of the buckets and stretches of a period."""

    def __init__(
        self, buckets: Buckets, stretches: Stretches, interval_s: float, priced: _Priced, standby: Standby | None
    ) -> None:
        self._buckets, self._stretches, self._priced, self._standby = buckets, stretches, priced, standby
        self._known_s = known_seconds(buckets, interval_s)
        self._quarters = _quarters(buckets, stretches, self._known_s)
        rest = set() if standby is None else set(buckets.start[standby.at_rest].tolist())
        self._at_rest = np.array([start in rest for start in stretches.start.tolist()], dtype=bool)

    def period(self, begin: int, end: int, mine: np.ndarray) -> Period:
        """`mine`: which stretches belong to the period."""
        b, nWh = self._buckets, self._stretches.nWh
        first, last = np.searchsorted(b.start, [begin, end])
        here = slice(int(first), int(last))
        P, rows = b.P[here], b.rows[here]
        finite = np.isfinite(P)
        tops = b.P_max[here][np.isfinite(b.P_max[here])]
        chosen = np.flatnonzero(mine).tolist()
        cost, co2 = self._priced.cost, self._priced.co2
        some = bool(chosen)
        return Period(
            begin, end, int(nWh[mine].sum()) if some else None,
            float(self._known_s[here].sum()),
            float(np.average(P[finite], weights=rows[finite])) if finite.any() else None,
            float(tops.max()) if len(tops) else None,
            self.demand(begin, end),
            None if cost is None or not some else self._priced.cost_unit * sum(cost.get(k, 0) for k in chosen),
            sum(int(nWh[k]) for k in self._priced.unpriced if mine[k]),
            None if co2 is None or not some else self._priced.co2_unit * sum(co2.get(k, 0) for k in chosen),
            sum(int(nWh[k]) for k in self._priced.no_co2 if mine[k]),
            None if self._standby is None or not some else int(nWh[mine & self._at_rest].sum()),
        )  # fmt: skip

    def demand(self, begin: int, end: int) -> Demand | None:
        """The highest complete quarter hour between Unix times [s]."""
        start, watts, whole = self._quarters
        here = (start >= begin) & (start + QUARTER_S <= end)
        usable = here & whole
        if not usable.any():
            return None
        best = int(np.argmax(np.where(usable, watts, -np.inf)))
        return Demand(float(watts[best]), int(start[best]), int((here & ~whole).sum()))


def _quarters(buckets: Buckets, stretches: Stretches, known_s: Floats) -> tuple[np.ndarray, Floats, np.ndarray]:
    """Start, mean power [W] and completeness of every quarter hour of UTC with rows."""
    start, place = np.unique(buckets.start // QUARTER_S * QUARTER_S, return_inverse=True)
    covered = np.bincount(place, known_s, minlength=len(start))
    whole = covered >= _WHOLE * QUARTER_S
    nWh = np.zeros(len(start))
    of = np.searchsorted(start, stretches.start // QUARTER_S * QUARTER_S)
    inside = (of < len(start)) & (stretches.kind == Kind.KNOWN)
    np.add.at(nWh, of[inside], stretches.nWh[inside].astype(np.float64))
    spoiled = of[(of < len(start)) & ((stretches.kind != Kind.KNOWN) | (stretches.begin < stretches.start))]
    whole[spoiled] = False
    return start, nWh / NWH_PER_KWH * 3.6e6 / QUARTER_S, whole
