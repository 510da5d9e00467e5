"""Energy and cost by part, program, step or state, from the rows in SQL: the register cut at every mark.

A row belongs to the value in whose time its window begins. What the register counted where rows lack belongs to a value
only if the gap lies within one of its visits. All values, gaps and steps together are the last reading minus the first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import sqlalchemy as sa

from acqd.energy.marks import Marks
from acqd.energy.read import NoRowsError, channel_of
from acqd.energy.stretches import NWH_PER_KWH, nwh
from acqd.energy.tariff import QUARTER_S, Tariff
from acqd.storage import buckets as stored
from acqd.storage.row_series import Piece, row_series
from acqd.timestamps import filetime

_TICKS = 10_000_000
_GAP = 1.5
"""Intervals of rows from which on rows lack."""
_CLEARLY, _COARSE_KWH = 1.5, 1.0
"""As in `stretches`: what a step may exceed the power by, and the resolution of the registers of large meters."""
_SAMPLED_S = 0.06
_BEFORE = ""
"""Name of the time before the first mark, and of marks without a value."""


@dataclass(slots=True)
class Marked:
    """Everything with one value."""

    name: str
    visits: int = 0
    seconds: float = 0.0
    known_s: float = 0.0
    """With rows."""
    nWh: int = 0
    cost: Fraction | None = None
    """EUR; None without a tariff."""
    unpriced_nWh: int = 0
    """Over a gap in which the price changes."""

    @property
    def kWh(self) -> float:  # noqa: N802
        """Energy."""
        return self.nWh / NWH_PER_KWH


@dataclass(slots=True)
class ByMark:
    """A device between two times."""

    device: str
    channel: str
    values: list[Marked]
    """In the order in which they appear; without a value last."""
    between_nWh: int
    """Over marks where rows lack: it belongs to no value."""
    jumps_nWh: int
    """Steps of the register that no power explains: no energy."""
    register_nWh: int
    rows: int
    simulated: bool


class _Gap(NamedTuple):
    """From a row to the next one, with rows lacking between."""

    nWh: int
    seconds: float
    marks: tuple[int, int]
    """Of both rows."""
    since: tuple[int, int]
    """Starts of the prices of both rows [Unix s]."""


@dataclass(slots=True)
class _State:
    nWh: dict[tuple[int, int], int] = field(default_factory=dict)
    """By mark and start of the price [Unix s]."""
    gaps: list[_Gap] = field(default_factory=list)
    most_W: float = 0.0
    """Largest |P| of all rows."""
    rows: dict[int, int] = field(default_factory=dict)
    jumps: int = 0
    first: int | None = None
    last: int | None = None
    count: int = 0


def by_mark(engine: sa.Engine, device: str, marks: Marks, begin: int, end: int, tariff: Tariff | None) -> ByMark:
    """Unix times [s]. Raises NoRowsError, UserError for several channels, or InputError where there is no price."""
    step_s = QUARTER_S if tariff is None else tariff.resolution
    with engine.connect() as connection:
        channel = channel_of(connection, device, begin, end)
        interval = stored.row_interval(connection, device, channel, begin, end)
        if interval is None:
            raise NoRowsError(f"device {device!r} has no rows in this period, only roll-ups at most; parts need rows")
        state = _State()
        for piece in _joined(row_series(connection, device, channel, begin, end)):
            _add(state, piece, marks, interval, step_s)
        simulated = stored.has_flag(connection, device, channel, begin, end, "simulated")
    if state.first is None or state.last is None:
        raise NoRowsError(f"device {device!r} has no rows with a register in this period")
    inside, between = _sorted_gaps(state, interval)
    return ByMark(
        device, channel, _values(state, inside, marks, begin, end, interval, tariff), between, state.jumps,
        state.last - state.first, state.count, simulated,
    )  # fmt: skip


def _joined(pieces: Iterator[Piece]) -> Iterator[Piece]:
    """Each piece with the last row of the one before in front."""
    last: Piece | None = None
    for piece in pieces:
        ticks, P, W = piece if last is None else tuple(
            np.concatenate([one, other]) for one, other in zip(last, piece, strict=True)
        )  # fmt: skip
        yield ticks, P, W
        last = ticks[-1:], P[-1:], W[-1:]


def _add(state: _State, piece: Piece, marks: Marks, interval_s: float, step_s: int) -> None:
    filetimes, P, W = piece
    ticks = filetimes - filetime(0)
    mark = np.searchsorted(marks.ticks, ticks, side="right") - 1
    since = ticks // (_TICKS * step_s) * step_s
    elapsed_s = np.diff(ticks) / _TICKS
    gap = elapsed_s > _GAP * interval_s
    most_W = float(np.abs(P[np.isfinite(P)]).max(initial=0.0))
    state.most_W = max(state.most_W, most_W)
    jump = np.abs(np.diff(W)) > _largest_kWh(most_W, elapsed_s, interval_s)
    fresh = slice(0 if state.first is None else 1, None)  # the first row was counted in the piece before
    for number, rows in zip(*np.unique(mark[fresh], return_counts=True), strict=True):
        state.rows[int(number)] = state.rows.get(int(number), 0) + int(rows)
    state.count += len(ticks[fresh])
    changed = gap | jump | (np.diff(mark) != 0) | (np.diff(since) != 0)
    breaks = np.flatnonzero(changed) + 1
    if state.first is None:
        state.first = nwh(float(W[0]))
    before = 0
    for k in [*breaks.tolist(), len(W)]:
        _count(state, int(mark[before]), int(since[before]), nwh(float(W[k - 1])) - nwh(float(W[before])))
        if k < len(W):
            energy = nwh(float(W[k])) - nwh(float(W[k - 1]))
            if gap[k - 1]:
                both = (int(mark[k - 1]), int(mark[k])), (int(since[k - 1]), int(since[k]))
                state.gaps.append(_Gap(energy, float(elapsed_s[k - 1]), *both))
            elif jump[k - 1]:
                state.jumps += energy
            else:
                _count(state, int(mark[k]), int(since[k]), energy)
        before = k
    state.last = nwh(float(W[-1]))


def _count(state: _State, mark: int, since: int, energy: int) -> None:
    """The energy [nWh] of rows that follow one another."""
    key = mark, since
    state.nWh[key] = state.nWh.get(key, 0) + energy


def _sorted_gaps(state: _State, interval_s: float) -> tuple[list[_Gap], int]:
    """Gaps within one visit, and the energy [nWh] over the others; steps of the register join the jumps.

    After all rows: what may have been used in a gap follows from the largest power of all of them.
    """
    inside, between = [], 0
    for gap in state.gaps:
        if abs(gap.nWh) > _largest_kWh(state.most_W, np.array(gap.seconds), interval_s) * NWH_PER_KWH:
            state.jumps += gap.nWh
        elif gap.marks[0] != gap.marks[1]:
            between += gap.nWh
        else:
            inside.append(gap)
    return inside, between


def _price_changes(tariff: Tariff, since: tuple[int, int]) -> bool:
    moments = np.arange(since[0], since[1] + 1, tariff.resolution)
    return len(set(tariff.prices(moments) or [])) > 1


def _largest_kWh(most_W: float, elapsed_s: np.ndarray, interval_s: float) -> np.ndarray:  # noqa: N802
    """What a power explains between two rows; more is a step of the register."""
    coarse = 0.0 if interval_s < _SAMPLED_S else _COARSE_KWH
    explained = _CLEARLY * (most_W * np.maximum(elapsed_s, interval_s) / 3.6e6 + coarse) + most_W * 1.5 / 3.6e6
    return np.asarray(explained)


def _values(
    state: _State, gaps: Sequence[_Gap], marks: Marks, begin: int, end: int, interval_s: float, tariff: Tariff | None
) -> list[Marked]:
    found: dict[str, Marked] = {}
    edges = np.concatenate([[begin * _TICKS], np.clip(marks.ticks, begin * _TICKS, end * _TICKS), [end * _TICKS]])
    lasting = np.diff(edges) / _TICKS
    priced = tariff is not None and tariff.price is not None
    of_mark = {}
    for number in range(-1, len(marks.names)):
        if lasting[number + 1] <= 0:
            continue
        name = marks.names[number] if number >= 0 else _BEFORE
        of = of_mark[number] = found.setdefault(name, Marked(name, cost=Fraction(0) if priced else None))
        of.visits += 1
        of.seconds += float(lasting[number + 1])
        of.known_s += min(state.rows.get(number, 0) * interval_s, float(lasting[number + 1]))
    for (number, _), energy in state.nWh.items():
        of_mark[number].nWh += energy
    for gap in gaps:
        of_mark[gap.marks[1]].nWh += gap.nWh
    if tariff is not None and priced:
        _add_costs(of_mark, state.nWh, gaps, tariff)
    return sorted(found.values(), key=lambda each: not each.name)


def _add_costs(
    of_mark: Mapping[int, Marked], rows: Mapping[tuple[int, int], int], gaps: Sequence[_Gap], tariff: Tariff
) -> None:
    """Import and export of a quarter hour are netted over all marks, as the bill of the device nets them."""
    net: dict[int, int] = {}
    for (_, since), energy in rows.items():
        net[since // QUARTER_S] = net.get(since // QUARTER_S, 0) + energy
    shares = [(mark, since, energy, net[since // QUARTER_S] >= 0) for (mark, since), energy in rows.items()]
    for gap in gaps:
        if _price_changes(tariff, gap.since):
            of_mark[gap.marks[1]].unpriced_nWh += gap.nWh
        else:
            shares.append((gap.marks[1], gap.since[1], gap.nWh, gap.nWh >= 0))
    prices = tariff.prices(np.array([since for _, since, _, _ in shares], dtype=np.int64)) or []
    for (mark, _, energy, imports), price in zip(shares, prices, strict=True):
        of = of_mark[mark]
        assert of.cost is not None
        of.cost += Fraction(energy, NWH_PER_KWH) * (price if imports else tariff.feed_in)
