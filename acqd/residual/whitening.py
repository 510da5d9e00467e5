"""Whitening: an autoregressive model of the residual, and its inverse filter.

Residuals of rows 40 ms apart are correlated. A method that assumes independent rows detects effects in clean data.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_toeplitz, solve_triangular, toeplitz

from acqd.arrays import Floats
from acqd.numerics import mad_sigma
from acqd.residual.thresholds import NOISE

_DIFFUSE = 1e3
"""Variance of an unknown level relative to that of the noise."""
_AT_ONCE = 32
"""Rows that are filtered by one product with a band of taps: few zeros in the band, and long rows for BLAS."""
_FEW = 4
"""Columns that are convolved one by one instead: rows of so few columns are too short for BLAS."""


@dataclass(frozen=True, slots=True)
class Whitener:
    """An autoregressive model of the noise, as a filter that turns it into white noise of unit variance."""

    taps: Floats
    """[order + 1]."""
    start: Floats
    """[order, order] lower triangular: rows of a segment without a past become white by the rows before them."""

    @classmethod
    def of(cls, residuals: list[Floats], order: int = NOISE.noise_order, *, known_level: bool = False) -> Whitener:
        """By the Yule-Walker equations from residuals [T] W of segments without gaps; outliers are clipped.

        Levels that differ from minute to minute are not part of this noise; blocks have random intercepts for them,
        and unless `known_level`, the first rows of a segment say nothing about its level either.
        """
        residuals = [
            part - part.mean()
            for each in residuals
            for part in np.array_split(each, max(1, len(each) // NOISE.block_rows))
        ]
        spread = mad_sigma(np.concatenate(residuals), 0.0) + 1e-9
        clipped = [np.clip(each, -NOISE.outlier * spread, NOISE.outlier * spread) for each in residuals]
        lags = np.zeros(order + 1)
        for each in clipped:
            for k in range(min(order + 1, len(each))):
                lags[k] += float(each[k:] @ each[: len(each) - k])
        # the biased estimate: the one by the rows of each lag may have an innovation without variance
        covariance = lags / sum(map(len, clipped))
        covariance[0] *= 1 + 1e-6
        weights = solve_toeplitz(covariance[:-1], covariance[1:])
        variance = max(float(covariance[0] - weights @ covariance[1:]), 1e-12)
        return cls(
            np.concatenate([[1.0], -weights]) / np.sqrt(variance),
            _start(covariance[:-1], 0.0 if known_level else _DIFFUSE),
        )

    @property
    def innovation(self) -> float:
        """Standard deviation [W] of a row given the rows before it."""
        return float(1 / self.taps[0])

    def apply(self, values: NDArray[Any]) -> Floats:
        """White rows [T - order, ...]; the first `order` rows are only the past of the others."""
        order, columns = len(self.taps) - 1, _columns(values)
        rows = max(len(values) - order, 0)
        white = np.empty((rows, columns.shape[1]))
        if rows and columns.shape[1] <= _FEW:
            for each, out in zip(columns.T, white.T, strict=True):
                out[:] = np.convolve(each, self.taps, "valid")
        else:
            for first, band in self._bands(rows):
                inside = columns[first : first + band.shape[1]]
                np.matmul(band, inside, out=white[first : first + len(band)])
        return white.reshape(rows, *values.shape[1:])

    def from_start(self, values: NDArray[Any]) -> Floats:
        """White rows [T, ...] of a segment without a past: it starts with a draw of the stationary process."""
        order = len(self.taps) - 1
        first = np.asarray(values[:order], dtype=np.float64)
        begin = self.start[: len(first), : len(first)] @ first.reshape(len(first), -1)
        return np.concatenate([begin.reshape(first.shape), self.apply(values)])

    def back(self, white: Floats, *, past: bool) -> Floats:
        """[T, ...]: the transposed filter, so that products of white rows are products of rows with its result.

        (F a)' M (F b) = a' (F' M F b): white rows of a hundred columns need not be stored. `past`: white rows are
        those of `apply`, else those of `from_start`.
        """
        order, columns = len(self.taps) - 1, _columns(white)
        begin = 0 if past else min(order, len(white))
        rows = len(white) - begin
        result = np.zeros((order + rows if past else len(white), columns.shape[1]))
        if rows and columns.shape[1] <= _FEW:
            for each, out in zip(columns[begin:].T, result.T, strict=True):
                out[:] = np.convolve(each, self.taps[::-1])
        else:
            for first, band in self._bands(rows):
                filtered = columns[begin + first : begin + first + len(band)]
                result[first : first + band.shape[1]] += band.T @ filtered
        if not past:
            result[:begin] += self.start[:begin, :begin].T @ columns[:begin]
        return result.reshape(len(result), *white.shape[1:])

    def _bands(self, rows: int) -> Iterator[tuple[int, Floats]]:
        """First row and band [n, n + order] of every few rows: the rows of a product with the band are white."""
        order, below = len(self.taps) - 1, np.zeros(_AT_ONCE - 1)
        band = toeplitz([self.taps[-1], *below], [*self.taps[::-1], *below])
        for first in range(0, rows, _AT_ONCE):
            here = min(_AT_ONCE, rows - first)
            yield first, band[:here, : here + order]


def _columns(values: NDArray[Any]) -> Floats:
    """[T, k] of values [T, ...]."""
    return np.asarray(values, dtype=np.float64).reshape(len(values), int(np.prod(values.shape[1:])))


def _start(covariance: Floats, level: float) -> Floats:
    """Inverse Cholesky factor [n, n] of the covariance of the first rows of a segment.

    The Toeplitz matrix of the autocovariances [n], plus an unknown level of `level` times the variance. Counts that
    differ from lag to lag may make the matrix indefinite: its eigenvalues are bounded from below.
    """
    values, vectors = np.linalg.eigh(toeplitz(covariance))
    matrix = (vectors * np.maximum(values, 1e-4 * values[-1])) @ vectors.T + level * covariance[0]
    return np.asarray(solve_triangular(cholesky(matrix, lower=True), np.eye(len(covariance)), lower=True))


def autocorrelation(residuals: list[Floats], lags: int) -> Floats:
    """[lags] autocorrelation at 1, 2 ... rows of pooled residuals [T] W, about their common mean."""
    mean = float(np.concatenate(residuals).mean())
    zero = sum(float(((each - mean) ** 2).sum()) for each in residuals)
    found = [
        sum(float((each[k:] - mean) @ (each[:-k] - mean)) for each in residuals if len(each) > k)
        for k in range(1, lags + 1)
    ]
    return np.array(found) / max(zero, 1e-12)
