"""Figures of merit of a residual: how large, how biased, how far from white noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.residual.whitening import autocorrelation

_LAGS = 25  # a second


@dataclass(frozen=True, slots=True)
class Quality:
    """Figures of merit of a prediction."""

    mae: float
    """Mean absolute error, W."""
    rmse: float
    """Root mean square error, W."""
    bias: float
    """Mean error, W, predicted minus measured."""
    residual_autocorrelation: float
    """RMS autocorrelation of the residual at lags up to one second: 0 for white noise, 1 if fully predictable."""

    def as_json(self) -> dict[str, float]:
        """For report.json; `whiteness` is the earlier name of the autocorrelation."""
        return {
            "mae": self.mae,
            "rmse": self.rmse,
            "bias": self.bias,
            "whiteness": self.residual_autocorrelation,
            "residual_autocorrelation": self.residual_autocorrelation,
        }


def quality(errors: list[Floats]) -> Quality:
    """Of residuals (measured minus predicted) [T] W per segment."""
    together = np.concatenate(errors)
    rho = autocorrelation(errors, _LAGS)
    return Quality(
        mae=float(np.abs(together).mean()),
        rmse=float(np.sqrt((together**2).mean())),
        bias=float(-together.mean()),
        residual_autocorrelation=float(np.sqrt((rho**2).mean())),
    )
