"""Blocks of some seconds: their figures, and the scale of figures of an unchanged robot at rest and in motion.

Rows are correlated, and their spread depends on whether the arm moves. Blocks are therefore compared with blocks of the
same kind, at rest or in motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.monitor.thresholds import MONITOR
from acqd.numerics import mad_sigma
from acqd.residual.thresholds import NOISE
from acqd.residual.whitening import Whitener


@dataclass(frozen=True, slots=True)
class Blocks:
    """Consecutive blocks of a segment."""

    start_s: Floats
    """[n] UTC."""
    rows: list[slice]
    """[n] of the segment."""
    kinds: NDArray[np.intp]
    """[n] 0 at rest, 1 in motion."""
    figures: Floats
    """[n, 3]: mean residual (W), log of the mean square of the white residual, and of the residual as it is."""


def blocks_of(whitener: Whitener, errors: Floats, predicted: Floats, start_s: float, step_s: float) -> Blocks:
    """Blocks of a segment; a remainder shorter than half a block is left out."""
    size = round(MONITOR.cusum_block_s / step_s)
    white = (
        np.concatenate([np.full(NOISE.noise_order, np.nan), whitener.apply(errors)])
        if len(errors) > NOISE.noise_order
        else errors * np.nan
    )
    starts, slices, kinds, figures = [], [], [], []
    for first in range(0, len(errors), size):
        rows = slice(first, first + size)
        inner = white[rows][np.isfinite(white[rows])]
        if len(errors[rows]) < size / 2 or len(inner) < size / 4:
            continue
        starts.append(start_s + first * step_s)
        slices.append(rows)
        kinds.append(int(predicted[rows].std() > MONITOR.cusum_moving_W))
        sizes = (float(np.mean(np.square(values))) for values in (inner, errors[rows]))
        figures.append([float(errors[rows].mean()), *(np.log(max(each, 1e-12)) for each in sizes)])
    return Blocks(np.array(starts), slices, np.array(kinds, dtype=np.intp), np.array(figures).reshape(-1, 3))


@dataclass(frozen=True, slots=True)
class Scale:
    """Centre and spread of figures, at rest and in motion."""

    centre: Floats
    """[2, k] medians."""
    spread: Floats
    """[2, k] robust standard deviations."""

    @classmethod
    def of(cls, figures: Floats, kinds: NDArray[np.intp], least: Floats) -> Scale:
        """From figures [n, k] of blocks, NaN where unknown; `least`: lower bounds [k] of the spread.

        A kind with too few blocks has the scale of all blocks.
        """
        centre, spread = np.empty((2, figures.shape[1])), np.empty((2, figures.shape[1]))
        for kind in (0, 1):
            for number, column in enumerate(figures.T):
                known = np.isfinite(column)
                alike = known & (kinds == kind)
                values = column[alike if alike.sum() >= MONITOR.cusum_fewest_blocks else known]
                centre[kind, number] = np.median(values)
                sigma = mad_sigma(values, float(centre[kind, number]))
                spread[kind, number] = max(sigma, float(values.std()) / 2, float(least[number]))
        return cls(centre, spread)

    def standardised(self, figures: Floats, kinds: NDArray[np.intp]) -> Floats:
        """[n, k] deviations from the centre in units of the spread."""
        return np.asarray((figures - self.centre[kinds]) / self.spread[kinds])
