"""Energy by cause of spans of rows, with the residual and what the joints give back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd import student
from acqd.arrays import Floats
from acqd.balance.rows import Rows
from acqd.models.effects.cause import Cause

_J_PER_KWH = 3.6e6
_BLOCK_S = 20.0
"""Length of a block where there are too few recordings: errors of a model are correlated over seconds."""
_FEWEST = 5
"""Blocks, for an interval."""


@dataclass(frozen=True, slots=True)
class Entry:
    """Energy of a part."""

    cause: Cause
    name: str
    added: bool
    """An effect that the loop added."""
    joints: Floats
    """[axes + 1] kWh by joint; the last is of no joint."""
    EUR_joints: Floats | None
    """[axes + 1] EUR at the prices of the rows; None without a tariff."""

    @property
    def EUR(self) -> float | None:  # noqa: N802
        """Of all joints."""
        return None if self.EUR_joints is None else float(self.EUR_joints.sum())

    @property
    def kWh(self) -> float:  # noqa: N802
        """Of all joints."""
        return float(self.joints.sum())


@dataclass(frozen=True, slots=True)
class Returned:
    """What braking and lowering joints give back, moment by moment, in kWh."""

    joints: Floats
    """[axes] by joint."""
    to_joints: float
    """Used by other joints at the same moment."""
    to_electronics: float
    """Used by what the robot takes beside its drives."""
    burnt: float
    """In the brake resistor, as far as the model has one."""
    to_mains: float
    """Negative predicted power."""


@dataclass(frozen=True, slots=True)
class Span:
    """A recording, a period of time, or all rows."""

    label: str
    seconds: float
    moving: float
    """Share of the rows in which a joint moves."""
    entries: list[Entry]
    measured: float
    """kWh."""
    residual: float
    """kWh, measured minus predicted: with the entries, this is the measured energy."""
    residual_half: float | None
    """Half width of the residual's 95 % interval, kWh; None from fewer than five blocks."""
    returned: Returned
    EUR: float | None
    """Of the measured energy."""

    @property
    def predicted(self) -> float:
        """kWh, the sum of the entries."""
        return sum(each.kWh for each in self.entries)

    def by_cause(self) -> dict[Cause, float]:
        """kWh of the causes that the model has, in their order."""
        have = {each.cause for each in self.entries}
        return {cause: sum(e.kWh for e in self.entries if e.cause == cause) for cause in Cause if cause in have}


@dataclass(frozen=True, slots=True)
class Balance:
    """Spans of a dataset, and all of them together."""

    by: str
    spans: list[Span]
    total: Span
    axes: int


def balance_of(rows: Rows, by: str, labels: np.ndarray, price: Floats | None) -> Balance:
    """Sum rows with the same of `labels` [T], in the order in which labels appear; `price` [T] in EUR per kWh."""
    order = list(dict.fromkeys(labels.tolist()))
    spans = [_span(rows, label, np.flatnonzero(labels == label), price) for label in order]
    return Balance(by, spans, _span(rows, "all", np.arange(len(labels)), price), rows.axes)


def _span(rows: Rows, label: str, chosen: np.ndarray, price: Floats | None) -> Span:
    energy = rows.step_s / _J_PER_KWH
    paid = None if price is None else price[chosen] * energy
    entries = [
        Entry(
            each.cause, each.name, each.added, each.joints[chosen].sum(axis=0) * energy,
            None if paid is None else paid @ each.joints[chosen],
        )
        for each in rows.parts
    ]  # fmt: skip
    residual = rows.residual[chosen]
    half = mean_half_width(residual, _blocks(rows, chosen))
    return Span(
        label, len(chosen) * rows.step_s, float(rows.moving[chosen].mean()), entries,
        float(rows.P[chosen].sum()) * energy, float(residual.sum()) * energy,
        None if half is None else half * len(chosen) * energy, _returned(rows, chosen),
        None if paid is None else float(paid @ rows.P[chosen]),
    )  # fmt: skip


def _blocks(rows: Rows, chosen: np.ndarray) -> np.ndarray:
    """[n] number of the block of every row: its recording, or with fewer than five recordings 20 s of it."""
    _, recording = np.unique(rows.recording[chosen], return_inverse=True)
    if recording.max() + 1 >= _FEWEST:
        return np.asarray(recording)
    _, block = np.unique(np.column_stack([recording, rows.time[chosen] // _BLOCK_S]), axis=0, return_inverse=True)
    return np.asarray(block).ravel()


def mean_half_width(values: Floats, block: np.ndarray) -> float | None:
    """Half width of the 95 % interval of a mean, from blocks [n] as units (ratio estimator; Cochran 1977, 6.3)."""
    count = int(block.max()) + 1
    if count < _FEWEST:
        return None
    sums, sizes = np.bincount(block, values), np.bincount(block)
    spread = sums - values.mean() * sizes
    variance = count / (count - 1) * float(spread @ spread) / len(values) ** 2
    return float(student.ppf(0.975, count - 1) * np.sqrt(variance))


def _returned(rows: Rows, chosen: np.ndarray) -> Returned:
    energy = rows.step_s / _J_PER_KWH
    joints = np.sum([each.joints[chosen, :-1] for each in rows.parts], axis=0)
    back = np.maximum(-joints, 0.0)
    beyond = np.maximum(-joints.sum(axis=1), 0.0)
    fed = np.minimum(np.maximum(-rows.predicted[chosen], 0.0), beyond)
    burning: Sequence[Floats] = [each.power[chosen] for each in rows.parts if each.cause == Cause.BURNT]
    burnt = np.minimum(np.maximum(np.sum(burning, axis=0), 0.0), beyond - fed) if burning else np.zeros(len(chosen))
    return Returned(
        back.sum(axis=0) * energy, float((back.sum(axis=1) - beyond).sum()) * energy,
        float((beyond - fed - burnt).sum()) * energy, float(burnt.sum()) * energy, float(fed.sum()) * energy,
    )  # fmt: skip
