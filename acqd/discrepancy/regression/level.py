"""Products of columns within a block whose level is unknown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.gram import Gram, Indices


@dataclass(frozen=True, slots=True)
class UnknownLevel:
    """A Gram matrix with a random intercept of every block integrated out (Schur complement of its column)."""

    gram: Gram
    one: int
    """Index of the constant column."""
    precision: float = 0.0
    """1 / variance of the intercepts; 0: the level is free, so that products are those about the mean."""

    def take(self, block: int, rows: Indices, columns: Indices) -> Floats:
        """[rows, columns] of a block."""
        one = np.array([self.one])
        sums, squares = self.gram.take(block, rows, one), self.gram.take(block, one, one)
        explained = self.gram.take(block, one, columns) / np.maximum(squares + self.precision, 1e-12)
        return np.asarray(self.gram.take(block, rows, columns) - sums @ explained)

    def residual_products(self, block: int, columns: Indices) -> Floats:
        """[columns] products of columns with the measured residual."""
        return self.take(block, columns, np.array([self.gram.y]))[:, 0]
