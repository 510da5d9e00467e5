"""The moments of switching within rows: a row of power is a mean, so that a load may be on for a part of the row.

White noise weighs the steps of a load most. A column that steps one row too early or too late, or in one step where
the power takes two, makes the load seem too small (attenuation by errors in the regressor).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.residual.whitening import Whitener

_ROUNDS = 3


def shares_of_rows(
    residuals: list[Floats], whitener: Whitener, levels: list[Floats], on: list[NDArray[np.bool_]], size: float
) -> tuple[list[Floats], float]:
    """Share [T] of every row in which the load is on, per segment, and its size by least squares with these shares.

    `residuals` and `levels` [T]: W, and W per unit while on; `on` [T]: the likeliest states; `size`: in those units.
    Size and shares are fitted in turn. Segments shorter than the whitener keep their states.
    """
    long = [k for k, each in enumerate(residuals) if len(each) > 2 * len(whitener.taps)]
    white = {k: whitener.apply(residuals[k]) for k in long}
    shares = [each.astype(np.float64) for each in on]
    for _ in range(_ROUNDS):
        shares = [each.astype(np.float64) for each in on]
        for k in long:
            _refine(shares[k], white[k], whitener, levels[k], size)
        columns = {k: whitener.apply(levels[k] * shares[k]) for k in long}
        energy = sum(float(column @ column) for column in columns.values())
        if energy > 0:
            size = sum(float(white[k] @ columns[k]) for k in long) / energy
    return shares, size


def _refine(share: Floats, white: Floats, whitener: Whitener, level: Floats, size: float) -> None:
    """Change `share` in the last row before every switching, or in the first row after it, whichever explains more."""
    lost = len(whitener.taps) - 1
    left = white - size * whitener.apply(level * share)
    for edge in (np.flatnonzero(np.diff(share)) + 1).tolist():
        if edge <= lost:
            continue
        rise = float(share[edge] - share[edge - 1])
        before, after = (
            _Change.of(left, whitener.taps, size * float(level[row]), row - lost, wanted)
            for row, wanted in ((edge - 1, rise), (edge, -rise))
        )
        best = before if before.gain > after.gain else after
        if best.gain > 0:
            share[best.row + lost] += best.share
            left[best.rows] -= best.response * best.share


@dataclass(frozen=True, slots=True)
class _Change:
    """Another share in one row."""

    row: int
    """Of the white rows."""
    share: float
    """Added to the share."""
    response: Floats
    """White power per unit of the share."""
    gain: float
    """Reduction of the white squared error."""

    @classmethod
    def of(cls, left: Floats, taps: Floats, size: float, row: int, wanted: float) -> _Change:
        """The best change between 0 and `wanted` for a load of `size` in W, where `left` [T] is not explained."""
        response = size * taps[: len(left) - row]
        energy = float(response @ response)
        product = float(left[row : row + len(response)] @ response)
        best = product / energy if energy > 0 else 0.0
        share = float(np.clip(best, min(wanted, 0.0), max(wanted, 0.0)))
        return cls(row, share, response, 2 * share * product - share**2 * energy)

    @property
    def rows(self) -> slice:
        """White rows that change."""
        return slice(self.row, self.row + len(self.response))
