"""A sequential test on a residual: CUSUM charts of its level and its variance, against a baseline of the model.

Rows are correlated, and their spread depends on whether the arm moves. Blocks of some seconds are therefore compared
with blocks of the same kind, at rest or in motion, among the recordings that the bundle remembers (CUSUM: Page 1954).

The bounds of the charts follow from the same blocks (`bound.py`). What acts once per recording, such as a surge when
the brakes open, is in too few blocks for these charts and has a fifth one (`start_peak.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.monitor.bound import bound
from acqd.discrepancy.monitor.start_peak import StartPeaks, start_peak
from acqd.discrepancy.residual.whitening import Whitener
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.numerics import mad_sigma

CHARTS = ("level up", "level down", "whitened variance up", "raw variance up", "peak at the start up")
_START = CHARTS.index("peak at the start up")


@dataclass(frozen=True, slots=True)
class Blocks:
    """Figures of consecutive blocks."""

    start_s: Floats
    """[n] UTC."""
    moving: Floats
    """[n] 0 or 1."""
    figures: Floats
    """[n, 3]: mean residual (W), log of the mean square of the white residual, and of the residual as it is."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """The residual of an unchanged robot."""

    whitener: Whitener
    centre: Floats
    """[2, 3] median of blocks at rest and in motion."""
    spread: Floats
    """[2, 3]."""
    bounds: Floats
    """[4] of the charts of blocks."""
    start: StartPeaks | None
    """Of the peaks at the start of recordings; None where too few recordings start at rest."""
    seconds: float
    """Recorded time that it is based on."""

    @classmethod
    def of(
        cls, errors: list[Floats], predicted: list[Floats], starts_s: list[float], step_s: float, between_s: float,
        kept: Callable[[Floats], Floats] = np.asarray,
    ) -> Baseline | None:  # fmt: skip
        """From residuals and predictions [T] W of recordings; `between_s`: mean time between false alarms.

        `kept`: what is charted, [n, 3], of the blocks' figures [n, 3]. None when the recordings are too few.
        """
        whitener = Whitener.of(errors)
        in_time = sorted(zip(starts_s, range(len(errors)), strict=True))
        parts = [blocks_of(whitener, errors[k], predicted[k], start, step_s) for start, k in in_time]
        figures = kept(np.concatenate([part.figures for part in parts]))
        moving = np.concatenate([part.moving for part in parts])
        if len(figures) < THRESHOLDS.cusum_fewest_blocks:
            return None
        centre, spread = np.empty((2, 3)), np.empty((2, 3))
        for kind in (0, 1):
            own = figures[moving == kind] if (moving == kind).sum() >= THRESHOLDS.cusum_fewest_blocks else figures
            centre[kind] = np.median(own, axis=0)
            sigma = np.array([mad_sigma(column, middle) for column, middle in zip(own.T, centre[kind], strict=True)])
            spread[kind] = np.maximum(sigma, own.std(axis=0) / 2)
        spread = np.maximum(spread, (0.02, 0.05, 0.05))
        z = charted((figures - centre[moving.astype(int)]) / spread[moving.astype(int)])
        bounds = np.array([bound(column, between_s / THRESHOLDS.cusum_block_s) for column in z.T])
        seconds = len(figures) * THRESHOLDS.cusum_block_s
        peaks = [start_peak(errors[k], predicted[k], step_s) for _, k in in_time]
        start = StartPeaks.of([peak for peak in peaks if peak is not None], between_s / seconds)
        return cls(whitener, centre, spread, bounds, start, seconds)


def blocks_of(whitener: Whitener, errors: Floats, predicted: Floats, start_s: float, step_s: float) -> Blocks:
    """Blocks of a segment; a remainder shorter than half a block is left out."""
    size = round(THRESHOLDS.cusum_block_s / step_s)
    white = (
        np.concatenate([np.full(THRESHOLDS.noise_order, np.nan), whitener.apply(errors)])
        if len(errors) > THRESHOLDS.noise_order
        else errors * np.nan
    )
    starts, moving, figures = [], [], []
    for first in range(0, len(errors), size):
        rows = slice(first, first + size)
        inner = white[rows][np.isfinite(white[rows])]
        if len(errors[rows]) < size / 2 or len(inner) < size / 4:
            continue
        starts.append(start_s + first * step_s)
        moving.append(float(predicted[rows].std() > THRESHOLDS.cusum_moving_W))
        sizes = (float(np.mean(np.square(values))) for values in (inner, errors[rows]))
        figures.append([float(errors[rows].mean()), *(np.log(max(each, 1e-12)) for each in sizes)])
    return Blocks(np.array(starts), np.array(moving), np.array(figures).reshape(-1, 3))


def charted(z: Floats) -> Floats:
    """[n, 4] increments of the charts of blocks, from standardised figures [n, 3]."""
    z = np.clip(z, -THRESHOLDS.cusum_clip, THRESHOLDS.cusum_clip)
    return np.column_stack([z[:, 0], -z[:, 0], z[:, 1], z[:, 2]])


@dataclass(frozen=True, slots=True)
class Alarm:
    """The residual has changed."""

    chart: str
    onset_s: float
    """UTC of the block from which the values lie on a higher level: the onset estimate."""
    raised_s: float
    """UTC of the end of the block that raised the alarm."""
    height: float
    """Sum over bound."""

    def as_json(self) -> dict[str, Any]:
        """For MQTT and for files."""
        return {
            "chart": self.chart, "onset_s": self.onset_s, "raised_s": self.raised_s, "height": round(self.height, 3)
        }  # fmt: skip


def onset(blocks: list[tuple[float, float]]) -> float:
    """UTC of the most likely step in the values since the chart last was zero; the first block if there is no step.

    The chart may have left zero before the step, for a smaller reason.
    """
    values = np.array([value for _, value in blocks])
    count = np.arange(1, len(values))
    before, after = np.cumsum(values)[:-1] / count, np.cumsum(values[::-1])[::-1][1:] / (len(values) - count)
    apart = count * (len(values) - count) / len(values) * (after - before) ** 2  # squared error that a step takes away
    rising = np.flatnonzero(after - before > THRESHOLDS.cusum_step)
    if not len(rising):
        return blocks[0][0]
    return blocks[int(rising[apart[rising].argmax()]) + 1][0]


@dataclass(slots=True)
class Monitor:
    """The charts; takes segments in the order of time."""

    baseline: Baseline
    sums: Floats = field(default_factory=lambda: np.zeros(len(CHARTS)))
    since: list[list[tuple[float, float]]] = field(default_factory=lambda: [[] for _ in CHARTS])
    """UTC and value of the blocks since a sum was zero, per chart."""
    judged_s: float = 0.0
    """UTC up to which rows were judged; a recording that is repeated or late is ignored."""
    alarm: Alarm | None = None
    """The first alarm; it stays until the monitor is replaced."""

    def update(self, errors: Floats, predicted: Floats, start_s: float, step_s: float) -> Alarm | None:
        """Judge a segment; return the alarm that it raises, None without a new alarm."""
        if self.alarm is not None or start_s < self.judged_s:
            return None  # raised already, or rows that were judged before
        self.judged_s = start_s + len(errors) * step_s
        base = self.baseline
        blocks = blocks_of(base.whitener, errors, predicted, start_s, step_s)
        kinds = blocks.moving.astype(int)
        z = charted((blocks.figures - base.centre[kinds]) / base.spread[kinds])
        bounds = np.append(base.bounds, np.inf if base.start is None else base.start.bound)
        peak = None if base.start is None else start_peak(errors, predicted, step_s)
        for number, (block_s, values) in enumerate(zip(blocks.start_s.tolist(), z, strict=True)):
            for chart, value in enumerate(values):
                self._add(chart, block_s, float(value))
            if number == 0 and base.start is not None and peak is not None:
                self._add(_START, block_s, base.start.charted(peak))
            highest = int(np.argmax(self.sums / bounds))
            height = float(self.sums[highest] / bounds[highest])
            if height > 1.0:
                self.alarm = Alarm(
                    CHARTS[highest], onset(self.since[highest]), block_s + THRESHOLDS.cusum_block_s, height
                )
                return self.alarm
        return None

    def _add(self, chart: int, block_s: float, value: float) -> None:
        if self.sums[chart] == 0.0:
            self.since[chart].clear()
        self.since[chart] = [*self.since[chart][-THRESHOLDS.cusum_remembered :], (block_s, value)]
        self.sums[chart] = max(0.0, self.sums[chart] + value - THRESHOLDS.cusum_slack)

    def as_json(self) -> dict[str, Any]:
        """State, to continue after a restart."""
        alarm = None if self.alarm is None else self.alarm.as_json()
        return {"sums": self.sums.tolist(), "since": [list(map(list, each)) for each in self.since],
                "judged_s": self.judged_s, "alarm": alarm}  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Restore the state of `as_json`. Raises KeyError, ValueError, TypeError."""
        sums, since = list(state["sums"]), list(state["since"])
        if len(sums) == _START:  # of a version without the chart of starts
            sums, since = [*sums, 0.0], [*since, []]
        self.sums = np.array(sums, dtype=float).reshape(len(CHARTS))
        self.since = [[(float(t), float(value)) for t, value in each] for each in since]
        self.judged_s = float(state["judged_s"])
        self.alarm = None if state["alarm"] is None else Alarm(**state["alarm"])
