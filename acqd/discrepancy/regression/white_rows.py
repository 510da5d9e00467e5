"""Rows of a block, and what the noise model makes of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import DesignColumns, Part
from acqd.discrepancy.regression.gram import upper_triangle
from acqd.residual.whitening import Whitener


def block_rows(columns: DesignColumns, part: Part, first: int | None = None) -> NDArray[np.float32]:
    """[rows, k + 1] the `first` k columns (all: None) and the residual of a block with its past, not white."""
    residual = columns.residual[part.segment][part.rows, None]
    return np.concatenate([columns.values[part.segment][part.rows, :first], residual.astype(np.float32)], axis=1)


def white_rows(whitener: Whitener, part: Part, values: NDArray[Any]) -> Floats:
    """White rows of a block from its rows and its past."""
    return by_noise(part, whitener.apply(values) if part.past else whitener.from_start(values))


def by_noise(part: Part, white: Floats) -> Floats:
    """White rows [rows, ...] of a block, each divided by its noise."""
    return np.asarray((white.T / part.noise).T)


def white_products(columns: DesignColumns, whitener: Whitener, part: Part) -> Floats:
    """Upper triangle of the products [p + 1, p + 1] of a block's white rows."""
    white = white_rows(whitener, part, block_rows(columns, part))
    return upper_triangle(white.T @ white)
