"""The held-out test: how well a model predicts the rows of recordings that took no part.

Twice the log predictive density, up to a constant: the white squared error of rows, with a random level of every minute
integrated out, so that a load that the recordings share with the reference decides nothing (ADR 26).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.setup import LEAST_LEVEL_W
from acqd.discrepancy.selection.accepted import Selection
from acqd.residual.thresholds import NOISE
from acqd.residual.whitening import Whitener


@dataclass(frozen=True, slots=True)
class Predictive:
    """The noise of a selection."""

    whitener: Whitener
    level_W: float
    """Standard deviation of the level of a minute."""
    learning_rate: float

    @classmethod
    def of(cls, selection: Selection) -> Predictive:
        """With the noise model and the random intercepts of the selection."""
        levels = [column.deviation for column in selection.regression.columns if column.block_intercept]
        return cls(selection.design.whitener, levels[0] if levels else 0.0, selection.rows.learning_rate)

    def density(self, errors: list[Floats]) -> float:
        """Twice the log predictive density of errors [T] W of segments, up to a constant."""
        return -self.learning_rate * sum(self._squared(block) for block in _minutes(errors))

    def _squared(self, error: Floats) -> float:
        """White squared error of a block whose level is random."""
        white, one = self.whitener.from_start(error), self.whitener.from_start(np.ones(len(error)))
        precision = 1 / max(self.level_W, LEAST_LEVEL_W) ** 2
        return float(white @ white - (white @ one) ** 2 / (one @ one + precision))


def _minutes(errors: list[Floats]) -> list[Floats]:
    """[T] W per block of at most a minute."""
    return [block for each in errors for block in np.array_split(each, max(1, round(len(each) / NOISE.block_rows)))]
