"""How far the charts of a residual went, as a p-value: for decisions over many robots, where one bound is not enough.

The monitor's bound h for one false alarm in B blocks grows with log B (Lundberg's exponent). A chart that reached
H times the bound has therefore reached a height that is exceeded by chance once in about B^H blocks. Exceedances
of a high level are nearly a Poisson process (Aldous 1989): within n blocks at least one occurs with the probability
1 - exp(-n / B^H). The charts are combined by Bonferroni's inequality.

The null hypothesis is composite: a drift of the standby power by a small share of the dynamic range, and an error that
is larger by `grown_factor` on motions that the model was not fitted on, are no changes. The p-value is that of the
least favourable unchanged robot, at the edge of both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.monitor.blocks import blocks_of
from acqd.monitor.cusum import Baseline, charted, onset
from acqd.monitor.thresholds import MONITOR

SCREEN_CHARTS = ("level up", "level down", "whitened variance up", "variance within blocks up")
_LEAST_SQUARE = 1e-12


@dataclass(frozen=True, slots=True)
class Excursion:
    """The highest chart of a residual."""

    chart: str
    height: float
    """Largest sum over its bound."""
    onset_s: float
    """UTC of the block from which the values lie on a higher level."""
    blocks: int
    """Blocks that were judged."""
    p: float
    """Probability that an unchanged residual goes as far within as many blocks."""


def without_level(figures: Floats) -> Floats:
    """Figures [n, 3] of blocks with the variance within a block in place of the mean square.

    A standby power that drifts for minutes changes the mean square, the figure of which the monitor makes a chart.
    """
    inner = np.exp(figures[:, 2]) - figures[:, 0] ** 2
    return np.column_stack([figures[:, :2], np.log(np.maximum(inner, _LEAST_SQUARE))])


def largest_excursion(
    baseline: Baseline, between_s: float, range_W: float, rows: list[tuple[Floats, Floats, float]], step_s: float
) -> Excursion | None:
    """Of residuals and predictions [T] W with their start (UTC) per segment, in the order of time.

    `baseline`: of figures without level; `between_s`: recorded seconds per false alarm for which it has its bounds;
    `range_W`: dynamic range of the measured power. None without a whole block.
    """
    parts = [blocks_of(baseline.whitener, errors, predicted, start, step_s) for errors, predicted, start in rows]
    starts = np.concatenate([part.start_s for part in parts]) if parts else np.zeros(0)
    if not len(starts):
        return None
    kinds = np.concatenate([part.kinds for part in parts])
    figures = without_level(np.concatenate([part.figures for part in parts]))
    figures = figures - baseline.scale.centre[kinds]
    figures -= np.clip(figures, 0.0, 2 * np.log(MONITOR.screen_growth)) * (0.0, 1.0, 1.0)
    level_W = MONITOR.screen_level_share * range_W
    figures[:, 0] -= np.clip(figures[:, 0], -level_W, level_W)
    z = charted(figures / baseline.scale.spread[kinds])
    sums = np.column_stack([cusum(column) for column in z.T]) / baseline.bounds
    chart = int(np.argmax(sums.max(axis=0)))
    height = float(sums[:, chart].max())
    expected = len(starts) * np.exp(-height * np.log(between_s / MONITOR.cusum_block_s))
    p = float(min(1.0, len(SCREEN_CHARTS) * -np.expm1(-expected)))
    return Excursion(SCREEN_CHARTS[chart], height, _onset(starts, z[:, chart], sums[:, chart]), len(starts), p)


def cusum(values: Floats) -> Floats:
    """Page's sums [n] of the increments [n] less the slack."""
    steps = np.cumsum(values - MONITOR.cusum_slack)
    return np.asarray(steps - np.minimum(np.minimum.accumulate(steps), 0.0))


def _onset(starts: Floats, values: Floats, sums: Floats) -> float:
    """As the monitor dates an alarm: from the blocks between the last zero and the first value above the bound."""
    above = np.flatnonzero(sums > 1.0)
    last = int(above[0]) if len(above) else int(np.argmax(sums))
    zeros = np.flatnonzero(sums[:last] == 0.0)
    first = int(zeros[-1]) + 1 if len(zeros) else 0
    return onset(list(zip(starts[first : last + 1].tolist(), values[first : last + 1].tolist(), strict=True)))
