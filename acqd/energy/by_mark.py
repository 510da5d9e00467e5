"""Energy and cost by part, program, step or state, from the rows in SQL: the register cut at every mark.

A row belongs to the value in whose time its window begins. What the register counted where rows lack belongs to a value
only if the gap lies within one of its visits. All values, gaps and steps together are the last reading minus the first.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

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


@dataclass(slots=True)
class _State:
    nWh: dict[tuple[int, int], int] = field(default_factory=dict)
    """By mark and start of the price [Unix s]."""
    unpriced: dict[int, int] = field(default_factory=dict)
    rows: dict[int, int] = field(default_factory=dict)
    between: int = 0
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
            _add(state, piece, marks, interval, step_s, tariff)
        simulated = stored.has_flag(connection, device, channel, begin, end, "simulated")
    if state.first is None or state.last is None:
        raise NoRowsError(f"device {device!r} has no rows with a register in this period")
    return ByMark(
        device, channel, _values(state, marks, begin, end, interval, tariff), state.between, state.jumps,
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


def _add(
    state: _State, piece: Piece, marks: Marks, interval_s: float, step_s: int, tariff: Tariff | None
) -> None:  # fmt: skip
    filetimes, P, W = piece
    ticks = filetimes - filetime(0)
    mark = np.searchsorted(marks.ticks, ticks, side="right") - 1
    priced = ticks // (_TICKS * step_s)
    elapsed_s = np.diff(ticks) / _TICKS
    gap = elapsed_s > _GAP * interval_s
    jump = _jumps(np.diff(W), P, elapsed_s, interval_s)
    fresh = slice(0 if state.first is None else 1, None)  # the first row was counted in the piece before
    for number, rows in zip(*np.unique(mark[fresh], return_counts=True), strict=True):
        state.rows[int(number)] = state.rows.get(int(number), 0) + int(rows)
    state.count += len(ticks[fresh])
    changed = gap | jump | (np.diff(mark) != 0) | (np.diff(priced) != 0)
    breaks = np.flatnonzero(changed) + 1
    if state.first is None:
        state.first = nwh(float(W[0]))
    before = 0
    for k in [*breaks.tolist(), len(W)]:
        _count(state, int(mark[before]), int(priced[before]) * step_s, W[before], W[k - 1])
        if k < len(W):
            _step(state, piece, mark, priced * step_s, k, bool(gap[k - 1]), bool(jump[k - 1]), tariff)
        before = k
    state.last = nwh(float(W[-1]))


def _count(state: _State, mark: int, since: int, first: float, last: float) -> None:
    """The energy of rows that follow one another."""
    key = mark, since
    state.nWh[key] = state.nWh.get(key, 0) + nwh(float(last)) - nwh(float(first))


def _step(
    state: _State, piece: Piece, mark: np.ndarray, since: np.ndarray, k: int, gap: bool, jump: bool,
    tariff: Tariff | None,
) -> None:  # fmt: skip
    """The energy from a row to the next one where something changes."""
    energy = nwh(float(piece[2][k])) - nwh(float(piece[2][k - 1]))
    if jump:
        state.jumps += energy
    elif gap and mark[k] != mark[k - 1]:
        state.between += energy
    elif gap and tariff is not None and _price_changes(tariff, since[k - 1 : k + 1]):
        state.unpriced[int(mark[k])] = state.unpriced.get(int(mark[k]), 0) + energy
    else:
        key = int(mark[k]), int(since[k])
        state.nWh[key] = state.nWh.get(key, 0) + energy


def _price_changes(tariff: Tariff, since: np.ndarray) -> bool:
    moments = np.arange(since[0], since[1] + 1, tariff.resolution)
    return len(set(tariff.prices(moments) or [])) > 1


def _jumps(step_kWh: np.ndarray, P: np.ndarray, elapsed_s: np.ndarray, interval_s: float) -> np.ndarray:
    """Steps that the powers around them cannot explain."""
    finite = np.abs(P[np.isfinite(P)])
    most = float(finite.max()) if len(finite) else 0.0
    coarse = 0.0 if interval_s < _SAMPLED_S else _COARSE_KWH
    allowed = _CLEARLY * (most * np.maximum(elapsed_s, interval_s) / 3.6e6 + coarse) + most * 1.5 / 3.6e6
    return np.asarray(np.abs(step_kWh) > allowed)


def _values(
    state: _State, marks: Marks, begin: int, end: int, interval_s: float, tariff: Tariff | None
) -> list[Marked]:
    found: dict[str, Marked] = {}
    edges = np.concatenate([[begin * _TICKS], np.clip(marks.ticks, begin * _TICKS, end * _TICKS), [end * _TICKS]])
    lasting = np.diff(edges) / _TICKS
    priced = tariff is not None and tariff.price is not None
    for number in range(-1, len(marks.names)):
        if lasting[number + 1] <= 0:
            continue
        name = marks.names[number] if number >= 0 else _BEFORE
        of = found.setdefault(name, Marked(name, cost=Fraction(0) if priced else None))
        of.visits += 1
        of.seconds += float(lasting[number + 1])
        of.known_s += min(state.rows.get(number, 0) * interval_s, float(lasting[number + 1]))
        of.nWh += state.unpriced.get(number, 0)
        of.unpriced_nWh += state.unpriced.get(number, 0)
    names = [marks.names[number] if number >= 0 else _BEFORE for number, _ in state.nWh]
    prices = _prices(tariff, [since for _, since in state.nWh]) if tariff is not None and priced else None
    net: dict[tuple[int, int], int] = {}
    for (number, since), energy in state.nWh.items():
        quarter = number, since // QUARTER_S
        net[quarter] = net.get(quarter, 0) + energy
    for k, ((number, since), energy) in enumerate(state.nWh.items()):
        of = found[names[k]]
        of.nWh += energy
        if prices is not None and tariff is not None and of.cost is not None:
            imports = net[number, since // QUARTER_S] >= 0
            of.cost += Fraction(energy, NWH_PER_KWH) * (prices[k] if imports else tariff.feed_in)
    return sorted(found.values(), key=lambda each: not each.name)


def _prices(tariff: Tariff, moments: list[int]) -> list[Fraction]:
    return tariff.prices(np.array(moments, dtype=np.int64)) or []
