"""Gram matrices per block, so that a question about columns costs milliseconds, and no row is read again.

A block is a recording or a piece of a long one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

Indices: TypeAlias = NDArray[np.int64]
"""Indices of columns."""


@dataclass(frozen=True, slots=True)
class Gram:
    """Gram matrices of the blocks' columns; columns that were added later lie apart, so that adding copies little."""

    y: int
    """Index of the measured residual: the number p of the design's columns."""
    fixed: tuple[Floats, ...]
    """Per block the upper triangle, row by row, of the products [p + 1, p + 1] of the design's columns and of y."""
    added: Floats
    """[blocks, p + 1 + e, e] products of all columns with the e added ones."""

    @property
    def size(self) -> int:
        """Number of columns, y among them."""
        return int(self.added.shape[1])

    def take(self, block: int | slice | Indices, rows: Indices, columns: Indices) -> Floats:
        """[rows, columns] of one block, or [blocks, rows, columns] of several."""
        fixed = self.y + 1
        chosen = np.arange(len(self.fixed))[block]
        one = chosen.ndim == 0
        chosen = np.atleast_1d(chosen)
        values = np.empty((len(chosen), len(rows), len(columns)))
        row_old, column_old = rows < fixed, columns < fixed
        place = _in_triangle(rows[row_old], columns[column_old], fixed)
        if row_old.all() and column_old.all():
            for number, k in enumerate(chosen):
                np.take(self.fixed[k], place, out=values[number])
        else:
            old = np.ix_(row_old, column_old)
            for number, k in enumerate(chosen):
                values[number][old] = self.fixed[k][place]
            new = np.ix_(chosen, rows, columns[~column_old] - fixed)
            values[:, :, ~column_old] = self.added[new]
            mirrored = np.ix_(chosen, columns[column_old], rows[~row_old] - fixed)
            values[np.ix_(np.arange(len(chosen)), ~row_old, column_old)] = self.added[mirrored].transpose(0, 2, 1)
        return values[0] if one else values

    def residual_products(self, block: int | slice | Indices, columns: Indices) -> Floats:
        """[columns] (or [blocks, columns]) products of columns with the measured residual."""
        return self.take(block, columns, np.array([self.y]))[..., 0]

    def replaced(self, indices: Indices, products: list[Floats]) -> Gram:
        """With other values of added columns at `indices`; `products` [columns, indices] for every block.

        Indices behind the last column append columns.
        """
        fixed = self.y + 1
        size = max(self.size, int(indices.max()) + 1)
        added = np.zeros((len(self.fixed), size, size - fixed))
        added[:, : self.size, : self.size - fixed] = self.added
        for number, values in enumerate(products):
            added[number][:, indices - fixed] = values
            others = np.setdiff1d(np.arange(fixed, size), indices)
            added[number][np.ix_(indices, others - fixed)] = values[others].T
        return Gram(self.y, self.fixed, added)


def upper_triangle(matrix: Floats) -> Floats:
    """[n (n + 1) / 2] of a symmetric matrix [n, n], row by row."""
    return np.take(matrix, _triangle(len(matrix)))


def symmetric(triangle: Floats, size: int) -> Floats:
    """[size, size] of its `upper_triangle`."""
    matrix = np.zeros((size, size))
    matrix.flat[_triangle(size)] = triangle
    return matrix + np.triu(matrix, 1).T


@lru_cache(maxsize=4)
def _triangle(size: int) -> Indices:
    """[size (size + 1) / 2] indices into the elements of a matrix, row by row: those on or above the diagonal."""
    return np.flatnonzero(np.triu(np.ones((size, size), dtype=bool)))


def _in_triangle(rows: Indices, columns: Indices, size: int) -> Indices:
    """[rows, columns] indices into an upper triangle of a symmetric matrix [size, size]."""
    return _remembered_triangle(rows.tobytes(), columns.tobytes(), size)


@lru_cache(maxsize=8)
def _remembered_triangle(rows: bytes, columns: bytes, size: int) -> Indices:
    """Blocks after blocks are asked for the same columns."""
    first, second = (np.frombuffer(each, dtype=np.int64) for each in (rows, columns))
    return _upper(np.minimum.outer(first, second), np.maximum.outer(first, second), size)


def _upper(row: Indices, column: Indices, size: int) -> Indices:
    """Indices of elements on or above the diagonal."""
    return np.asarray(row * (2 * size - row - 1) // 2 + column)


@dataclass(frozen=True, slots=True)
class Blocks:
    """Products of all blocks."""

    white: Gram
    """Of whitened rows."""
    squares: Floats
    """[blocks, columns] W^2: sums over rows that are not white, y among the columns; 0 of blocks out of question."""
    rows: Floats
    """[blocks] number of white rows."""

    def __len__(self) -> int:
        return len(self.rows)
