"""How residuals of one row depend on those before: estimated, and taken out.

Rows 40 ms apart are not independent; every method that takes them to be finds "effects" in clean data.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.numerics import mad_sigma

ORDER = 30
_BLOCK = 1250  # rows


@dataclass(frozen=True, slots=True)
class Whitener:
    """An autoregressive model of the noise, as a filter that turns it into white noise of unit variance."""

    taps: Floats
    """[order + 1]."""

    @classmethod
    def of(cls, residuals: list[Floats], order: int = ORDER) -> Whitener:
        """From residuals [T] W of stretches without gaps; few outliers do no harm.

        Levels that differ from minute to minute are not this noise: who uses it gives every block its own.
        """
        residuals = [
            part - part.mean() for each in residuals for part in np.array_split(each, max(1, len(each) // _BLOCK))
        ]
        spread = mad_sigma(np.concatenate(residuals), 0.0) + 1e-9
        clipped = [np.clip(each, -5 * spread, 5 * spread) for each in residuals]
        lags = np.zeros(order + 1)
        counts = np.zeros(order + 1)
        for each in clipped:
            for k in range(min(order + 1, len(each))):
                lags[k] += float(each[k:] @ each[: len(each) - k])
                counts[k] += len(each) - k
        covariance = lags / np.maximum(counts, 1)
        covariance[0] *= 1 + 1e-6
        weights = solve_toeplitz(covariance[:-1], covariance[1:])
        variance = max(float(covariance[0] - weights @ covariance[1:]), 1e-12)
        return cls(np.concatenate([[1.0], -weights]) / np.sqrt(variance))

    @property
    def innovation(self) -> float:
        """Standard deviation [W] of what cannot be foreseen from the rows before."""
        return float(1 / self.taps[0])

    def apply(self, values: NDArray[Any]) -> NDArray[np.float32]:
        """White rows [T - order, ...] of a stretch."""
        return np.asarray(lfilter(self.taps, [1.0], values, axis=0)[len(self.taps) - 1 :], dtype=np.float32)


def autocorrelation(residuals: list[Floats], lags: int) -> Floats:
    """[lags] at rows 1, 2 ... of pooled residuals, each stretch about the common mean."""
    mean = float(np.concatenate(residuals).mean())
    zero = sum(float(((each - mean) ** 2).sum()) for each in residuals)
    found = [
        sum(float((each[k:] - mean) @ (each[:-k] - mean)) for each in residuals if len(each) > k)
        for k in range(1, lags + 1)
    ]
    return np.array(found) / max(zero, 1e-12)
