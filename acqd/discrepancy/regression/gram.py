"""Gram matrices per block, so that a question about columns costs milliseconds, and no row is read again.

A block is a recording or a piece of a long one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

Indices: TypeAlias = NDArray[np.int64]
"""Indices of columns."""


@dataclass(frozen=True, slots=True)
class Gram:
    """Gram matrices of the blocks' columns; columns that were added later lie apart, so that adding copies little.

    Designs that differ by some of the added columns share the products of all others.
    """

    y: int
    """Index of the measured residual: the number p of the design's columns."""
    fixed: tuple[Floats, ...]
    """Per block the upper triangle, row by row, of the products [p + 1, p + 1] of the design's columns and of y."""
    crossed: tuple[Floats, ...]
    """[blocks, p + 1] of each added column: its products with the design's columns and y."""
    among: Floats
    """[blocks, e, e] products of the e added columns."""

    @classmethod
    def of(cls, y: int, fixed: tuple[Floats, ...]) -> Gram:
        """Without added columns."""
        return cls(y, fixed, (), np.empty((len(fixed), 0, 0)))

    @property
    def size(self) -> int:
        """Number of columns, y among them."""
        return self.y + 1 + len(self.crossed)

    def take(self, block: int | slice | Indices, rows: Indices, columns: Indices) -> Floats:
        """[rows, columns] of one block, or [blocks, rows, columns] of several."""
        chosen = np.arange(len(self.fixed))[block]
        one = chosen.ndim == 0
        places = _places(rows.tobytes(), columns.tobytes(), self.y + 1)
        values = np.empty((chosen.size, len(rows), len(columns)))
        for k, out in zip(np.atleast_1d(chosen).tolist(), values, strict=True):
            if places.fixed is None:
                np.take(self.fixed[k], places.triangle, out=out)
                continue
            out[places.fixed] = self.fixed[k][places.triangle]
            for place, number in places.new_columns:
                out[places.row_old, place] = self.crossed[number][k].take(places.old_rows)
            for place, number in places.new_rows:
                out[place, places.column_old] = self.crossed[number][k].take(places.old_columns)
            out[places.new] = self.among[k][places.among]
        return values[0] if one else values

    def residual_products(self, block: int | slice | Indices, columns: Indices) -> Floats:
        """[columns] (or [blocks, columns]) products of columns with the measured residual."""
        return self.take(block, columns, np.array([self.y]))[..., 0]

    def replaced(self, indices: Indices, products: list[Floats]) -> Gram:
        """With other values of added columns at `indices`; `products` [columns, indices] for every block.

        Indices behind the last column append columns.
        """
        fixed = self.y + 1
        crossed, own = list(self.crossed), indices - fixed
        count = max(len(crossed), int(own.max()) + 1)
        crossed += [np.empty(0)] * (count - len(crossed))
        for k, number in enumerate(own.tolist()):
            crossed[number] = np.array([each[:fixed, k] for each in products])
        among = np.zeros((len(self.fixed), count, count))
        among[:, : self.among.shape[1], : self.among.shape[1]] = self.among
        for matrix, values in zip(among, products, strict=True):
            matrix[:, own] = values[fixed:]
            matrix[own] = values[fixed:].T
        return Gram(self.y, self.fixed, tuple(crossed), among)


def upper_triangle(matrix: Floats) -> Floats:
    """[n (n + 1) / 2] of a symmetric matrix [n, n], row by row."""
    return np.concatenate([row[k:] for k, row in enumerate(matrix)])


def symmetric(triangle: Floats, size: int) -> Floats:
    """[size, size] of its `upper_triangle`."""
    matrix, first = np.empty((size, size)), 0
    for k in range(size):
        matrix[k, k:] = matrix[k:, k] = triangle[first : first + size - k]
        first += size - k
    return matrix


class _Places(NamedTuple):
    """Where elements [rows, columns] lie: products of two columns of the design, and those with added ones."""

    fixed: tuple[Indices, Indices] | None
    """Of the rows and columns of the design; None: all."""
    triangle: Indices
    """Indices into the upper triangle."""
    row_old: Indices
    column_old: Indices
    """Of the rows, and of the columns, of the design."""
    old_rows: Indices
    old_columns: Indices
    """The same columns of the design."""
    new_rows: list[tuple[int, int]]
    new_columns: list[tuple[int, int]]
    """Of each added one, and its number among the added columns."""
    new: tuple[Indices, Indices]
    """Of the added rows and columns."""
    among: tuple[Indices, Indices]
    """Their numbers among the added columns."""


@lru_cache(maxsize=8)
def _places(rows: bytes, columns: bytes, size: int) -> _Places:
    """Of `size` columns of the design, y among them. Blocks after blocks are asked for the same columns."""
    first, second = (np.frombuffer(each, dtype=np.int64) for each in (rows, columns))
    row_old, row_new, column_old, column_new = (
        np.flatnonzero(each) for each in (first < size, first >= size, second < size, second >= size)
    )
    old_rows, old_columns, added_rows, added_columns = (
        first[row_old], second[column_old], first[row_new] - size, second[column_new] - size,
    )  # fmt: skip
    triangle = _upper(np.minimum.outer(old_rows, old_columns), np.maximum.outer(old_rows, old_columns), size)
    whole = not row_new.size and not column_new.size
    return _Places(
        None if whole else (row_old[:, None], column_old[None, :]), triangle,
        row_old, column_old, old_rows, old_columns,
        list(zip(row_new.tolist(), added_rows.tolist(), strict=True)),
        list(zip(column_new.tolist(), added_columns.tolist(), strict=True)),
        (row_new[:, None], column_new[None, :]), (added_rows[:, None], added_columns[None, :]),
    )  # fmt: skip


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
