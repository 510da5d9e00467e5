"""Noise that rises with the power: a model of power is wrong by a share of the power (ADR 100).

After whitening, the noise of standstill and slow motion is that of the meter. Where the arm brakes or turns round
within some rows, the model's own error is several times as large. With one deviation for all rows, a handful of these
would count like any others, and they are what effects differ in.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import DesignColumns, Part
from acqd.discrepancy.regression.white_rows import white_rows
from acqd.residual.whitening import Whitener


def new_power(columns: DesignColumns, whitener: Whitener, part: Part) -> Floats:
    """[rows] white: the predicted power of a block about its mean, as far as the rows before do not tell it."""
    predicted = columns.segments[part.segment].P[part.rows] - columns.residual[part.segment][part.rows]
    return white_rows(whitener, part, predicted - predicted.mean())


def usual_noise(rising: float, power: Floats) -> Floats:
    """[rows] standard deviation relative to that of rows without new power [rows]."""
    return np.sqrt(1 + rising * power**2)


def rising_of(left: Floats, power: Floats) -> float:
    """How fast the variance of white rows [n] rises with the square of their new power [n].

    Maximum likelihood of Laplace distributions, in which outliers hardly count; from none of the noise to all of it.
    """
    size = np.abs(left)

    def surprise(log_rising: float) -> float:
        deviation = usual_noise(np.exp(log_rising), power)
        # a fit that leaves nothing, as of rows without noise, has no logarithm
        return float(np.log(np.mean(size / deviation) + 1e-9) + np.mean(np.log(deviation)))

    scale = -np.log(max(float(np.mean(power**2)), 1e-12))
    found = minimize_scalar(surprise, bounds=(scale - 15, scale + 5), method="bounded", options={"xatol": 1e-9})
    return float(np.exp(found.x))
