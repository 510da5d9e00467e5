"""A sequential test on a live residual: CUSUMs of its level and its size, against what it was when the model was made.

Rows of a residual are not independent and their spread depends on whether the arm moves, so that blocks of some
seconds are compared with blocks of the same kind among the recordings that the bundle remembers. The bound of a CUSUM
follows from those blocks, too: with E exp(r (z - k)) = 1 independent blocks pass it by chance once in exp(r h) of them
(Lundberg, Wald); blocks that remember the one before count as so many fewer (their variance over long times).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import brentq

from acqd.arrays import Floats
from acqd.discrepancy.residual.whitening import ORDER, Whitener
from acqd.numerics import mad_sigma

BLOCK_S = 10.0
_CLIP = 4.0
"""Spreads that one block counts at most: a protective stop is no change."""
_SLACK = 0.75
_MOVING_W = 2.0
"""Standard deviation of the predicted power within a block that moves."""
_FEWEST_BLOCKS = 12
_STEP = 1.0  # spreads
_REMEMBERED = 2000  # blocks
CHARTS = ("level up", "level down", "size up", "slow size up")


@dataclass(frozen=True, slots=True)
class Blocks:
    """Figures of successive blocks."""

    start_s: Floats
    """[n] UTC."""
    moving: Floats
    """[n] 0 or 1."""
    figures: Floats
    """[n, 3]: mean residual (W), log of the mean square of the white residual, and of the residual as it is."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """What residuals are like when nothing has changed."""

    whitener: Whitener
    centre: Floats
    """[2, 3] of blocks at rest and in motion."""
    spread: Floats
    """[2, 3]."""
    bounds: Floats
    """[charts]."""
    seconds: float
    """Recorded time that it is based on."""

    @classmethod
    def of(
        cls, errors: list[Floats], predicted: list[Floats], starts_s: list[float], step_s: float, between_s: float
    ) -> Baseline | None:
        """From residuals and predictions [T] W of recordings; `between_s`: mean time between false alarms.

        None when they are too few.
        """
        whitener = Whitener.of(errors)
        in_time = sorted(zip(starts_s, range(len(errors)), strict=True))
        parts = [blocks_of(whitener, errors[k], predicted[k], start, step_s) for start, k in in_time]
        figures = np.concatenate([part.figures for part in parts])
        moving = np.concatenate([part.moving for part in parts])
        if len(figures) < _FEWEST_BLOCKS:
            return None
        centre, spread = np.empty((2, 3)), np.empty((2, 3))
        for kind in (0, 1):
            own = figures[moving == kind] if (moving == kind).sum() >= _FEWEST_BLOCKS else figures
            centre[kind] = np.median(own, axis=0)
            sigma = np.array([mad_sigma(column, middle) for column, middle in zip(own.T, centre[kind], strict=True)])
            spread[kind] = np.maximum(sigma, own.std(axis=0) / 2)
        spread = np.maximum(spread, (0.02, 0.05, 0.05))
        z = charted((figures - centre[moving.astype(int)]) / spread[moving.astype(int)])
        bounds = np.array([_bound(column, between_s / BLOCK_S) for column in z.T])
        return cls(whitener, centre, spread, bounds, len(figures) * BLOCK_S)


def blocks_of(whitener: Whitener, errors: Floats, predicted: Floats, start_s: float, step_s: float) -> Blocks:
    """Of one stretch; a rest shorter than half a block is left out."""
    size = round(BLOCK_S / step_s)
    white = np.concatenate([np.full(ORDER, np.nan), whitener.apply(errors)]) if len(errors) > ORDER else errors * np.nan
    starts, moving, figures = [], [], []
    for first in range(0, len(errors), size):
        rows = slice(first, first + size)
        inner = white[rows][np.isfinite(white[rows])]
        if len(errors[rows]) < size / 2 or len(inner) < size / 4:
            continue
        starts.append(start_s + first * step_s)
        moving.append(float(predicted[rows].std() > _MOVING_W))
        sizes = (float(np.mean(np.square(values))) for values in (inner, errors[rows]))
        figures.append([float(errors[rows].mean()), *(np.log(max(each, 1e-12)) for each in sizes)])
    return Blocks(np.array(starts), np.array(moving), np.array(figures).reshape(-1, 3))


def charted(z: Floats) -> Floats:
    """[n, charts] what each chart sums, from standardised figures [n, 3]."""
    z = np.clip(z, -_CLIP, _CLIP)
    return np.column_stack([z[:, 0], -z[:, 0], z[:, 1], z[:, 2]])


def _bound(z: Floats, blocks: float) -> float:
    """Height that a CUSUM of values like `z` (in the order of time) passes by chance once in so many blocks."""

    def moment(r: float) -> float:
        return float(np.mean(np.exp(r * (z - _SLACK)))) - 1.0

    off = z - z.mean()
    memory = float(off[1:] @ off[:-1]) / max(float(off @ off), 1e-12) + 1 / np.sqrt(len(z))  # rather too long
    memory = float(np.clip(memory, 0.0, 0.9))
    slower = (1 + memory) / (1 - memory)
    if z.max() <= _SLACK:
        return slower * float(np.log(blocks))
    high = 1.0
    while moment(high) < 0 and high < 64:
        high *= 2
    low = high
    while moment(low) >= 0 and low > 1e-3:
        low /= 2
    rate = float(brentq(moment, low, high)) if moment(low) < 0 <= moment(high) else low
    return slower * float(np.log(blocks)) / max(rate, 0.05)


@dataclass(frozen=True, slots=True)
class Alarm:
    """The residual is no longer what it was."""

    chart: str
    onset_s: float
    """UTC of the block in which the sum left nought for the last time: when it began, as near as it can be told."""
    raised_s: float
    """UTC of the end of the block that raised it."""
    height: float
    """Of the sum over its bound."""

    def as_json(self) -> dict[str, Any]:
        """For MQTT and for files."""
        return {
            "chart": self.chart, "onset_s": self.onset_s, "raised_s": self.raised_s, "height": round(self.height, 3)
        }  # fmt: skip


def onset(blocks: list[tuple[float, float]]) -> float:
    """UTC of the block from which on values lie on a higher level; the first block when they do so all along.

    A sum may have left nought before, for a smaller reason.
    """
    values = np.array([value for _, value in blocks])
    count = np.arange(1, len(values))
    before, after = np.cumsum(values)[:-1] / count, np.cumsum(values[::-1])[::-1][1:] / (len(values) - count)
    apart = count * (len(values) - count) / len(values) * (after - before) ** 2  # squared error that a step takes away
    rising = np.flatnonzero(after - before > _STEP)
    if not len(rising):
        return blocks[0][0]
    return blocks[int(rising[apart[rising].argmax()]) + 1][0]


@dataclass(slots=True)
class Monitor:
    """The charts' sums; give it stretches in the order of time."""

    baseline: Baseline
    sums: Floats = field(default_factory=lambda: np.zeros(len(CHARTS)))
    since: list[list[tuple[float, float]]] = field(default_factory=lambda: [[] for _ in CHARTS])
    """UTC and value of the blocks since each sum was nought."""
    judged_s: float = 0.0
    """UTC up to which rows were judged: a recording that comes again, or late, is not."""
    alarm: Alarm | None = None
    """The first; it stays until somebody has looked."""

    def update(self, errors: Floats, predicted: Floats, start_s: float, step_s: float) -> Alarm | None:
        """Take a stretch; the alarm that it raised, None if none or there had been one before."""
        if self.alarm is not None or start_s < self.judged_s:
            return None  # told already, or rows that were judged before
        self.judged_s = start_s + len(errors) * step_s
        base = self.baseline
        blocks = blocks_of(base.whitener, errors, predicted, start_s, step_s)
        kinds = blocks.moving.astype(int)
        z = charted((blocks.figures - base.centre[kinds]) / base.spread[kinds])
        for block_s, values in zip(blocks.start_s.tolist(), z, strict=True):
            for chart, value in enumerate(values):
                if self.sums[chart] == 0.0:
                    self.since[chart].clear()
                self.since[chart] = [*self.since[chart][-_REMEMBERED:], (block_s, float(value))]
                self.sums[chart] = max(0.0, self.sums[chart] + float(value) - _SLACK)
            highest = int(np.argmax(self.sums / base.bounds))
            height = float(self.sums[highest] / base.bounds[highest])
            if height > 1.0:
                self.alarm = Alarm(CHARTS[highest], onset(self.since[highest]), block_s + BLOCK_S, height)
                return self.alarm
        return None

    def as_json(self) -> dict[str, Any]:
        """To go on after a restart."""
        alarm = None if self.alarm is None else self.alarm.as_json()
        return {"sums": self.sums.tolist(), "since": [list(map(list, each)) for each in self.since],
                "judged_s": self.judged_s, "alarm": alarm}  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Where `as_json` left it. Raises KeyError, ValueError, TypeError."""
        self.sums = np.array(state["sums"], dtype=float).reshape(len(CHARTS))
        self.since = [[(float(t), float(value)) for t, value in each] for each in state["since"]]
        self.judged_s = float(state["judged_s"])
        self.alarm = None if state["alarm"] is None else Alarm(**state["alarm"])
