"""Charts of what acts in few rows: at high power, at low power, and where the tool switches.

A meter that saturates, or a DC link that clips regenerated power, changes only the highest or the lowest tenth of the
power, which the charts of whole blocks hardly see. A score test (Rao 1948) weights just these rows: of an error in
proportion to the predicted power beyond its decile, and of a power that the tool's signal switches. Residual and
regressors are whitened.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.segments import Segment
from acqd.monitor.blocks import Blocks, Scale
from acqd.monitor.bound import bound
from acqd.monitor.thresholds import MONITOR
from acqd.residual.whitening import Whitener

SCORES = ("residual at high power", "residual at low power", "power of the tool")
_LEAST_SPREAD = 0.5
"""Of a score, which has a standard deviation of 1 where the model is right."""


@dataclass(frozen=True, slots=True)
class ScoreCharts:
    """Scores of an unchanged robot."""

    whitener: Whitener
    deciles_W: Floats
    """[2] W: predicted power, upper and lower."""
    scale: Scale
    """Of the scores."""
    bounds: Floats
    """[2 scores] of the charts, each score up and down; infinite for a score that too few blocks have."""

    @classmethod
    def of(
        cls, whitener: Whitener, segments: Sequence[Segment], errors: Sequence[Floats], predicted: Sequence[Floats],
        blocks: Sequence[Blocks], between_s: float,
    ) -> ScoreCharts:  # fmt: skip
        """From residuals and predictions [T] W in the order of time; `between_s`: mean time between false alarms."""
        share = 100 * MONITOR.cusum_tail_share
        deciles = np.percentile(np.concatenate(list(predicted)), [100 - share, share])
        parts = [_scores(whitener, deciles, *each) for each in zip(segments, errors, predicted, blocks, strict=True)]
        scores, kinds = np.concatenate(parts), np.concatenate([own.kinds for own in blocks])
        enough = np.isfinite(scores).sum(axis=0) >= MONITOR.cusum_fewest_blocks
        scores[:, ~enough] = 0.0
        scale = Scale.of(scores, kinds, np.full(len(SCORES), _LEAST_SPREAD))
        count = between_s / MONITOR.cusum_block_s
        z = _both_sides(scale.standardised(scores, kinds)).T
        bounds = [
            bound(each[np.isfinite(each)], count) if usable else np.inf
            for each, usable in zip(z, np.repeat(enough, 2), strict=True)
        ]
        return cls(whitener, deciles, scale, np.array(bounds))

    def charted(self, segment: Segment, errors: Floats, predicted: Floats, blocks: Blocks) -> Floats:
        """[n, 2 scores] increments of the charts per block of a segment; NaN where a block has no such rows."""
        scores = _scores(self.whitener, self.deciles_W, segment, errors, predicted, blocks)
        return _both_sides(self.scale.standardised(scores, blocks.kinds))


def _scores(
    whitener: Whitener, deciles_W: Floats, segment: Segment, errors: Floats, predicted: Floats, blocks: Blocks
) -> Floats:
    """[n, scores] per block; NaN where it has no rows that would show."""
    tool = segment.signals.get("tool", np.zeros(len(errors)))
    high, low = np.maximum(predicted - deciles_W[0], 0.0), np.minimum(predicted - deciles_W[1], 0.0)
    white = whitener.apply(np.column_stack([errors, high, low, tool - tool.mean()]))
    order = len(whitener.taps) - 1
    scores = np.full((len(blocks.rows), len(SCORES)), np.nan)
    for number, rows in enumerate(blocks.rows):
        inner = white[max(rows.start - order, 0) : max(rows.stop - order, 0)]
        norm = np.sqrt(np.square(inner[:, 1:]).sum(axis=0))
        shown = _shown(norm, tool[rows])
        scores[number, shown] = (inner[:, 0] @ inner[:, 1:])[shown] / norm[shown]
    return scores


def _shown(norm: Floats, tool: Floats) -> NDArray[np.bool_]:
    """[scores]: an error as large as the power beyond the decile would show, and the tool switches."""
    return np.array([norm[0] > 1.0, norm[1] > 1.0, bool(np.ptp(tool) > 0 and norm[2] > 0)])


def _both_sides(z: Floats) -> Floats:
    """[n, 2 k] of [n, k]: up and down of each, clipped."""
    z = np.clip(z, -MONITOR.cusum_clip, MONITOR.cusum_clip)
    return np.stack([z, -z], axis=2).reshape(len(z), 2 * z.shape[1])
