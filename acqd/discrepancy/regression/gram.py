"""Generalised least squares as Gram matrices per block, so that a question about columns costs milliseconds.

A block is a recording or a piece of a long one: the unit of cross-validation and of the bootstrap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from acqd.arrays import Floats

Places: TypeAlias = NDArray[np.int64]
"""Indices of columns."""


@dataclass(frozen=True, slots=True)
class Gram:
    """Gram matrices of the blocks' columns; columns that were added later lie apart, so that adding copies little."""

    fixed: Floats
    """[blocks, p + 1, p + 1] of the design's columns and, at index p, the measured residual y."""
    added: Floats
    """[blocks, p + 1 + e, e] products of all columns with the e added ones."""

    @property
    def y(self) -> int:
        """Index of the measured residual."""
        return int(self.fixed.shape[1]) - 1

    @property
    def size(self) -> int:
        """Number of columns, y among them."""
        return int(self.added.shape[1])

    def take(self, block: int | slice | Places, rows: Places, columns: Places) -> Floats:
        """[rows, columns] of one block, or [blocks, rows, columns] of several."""
        fixed = self.y + 1
        chosen = np.arange(len(self.fixed))[block]
        one = chosen.ndim == 0
        chosen = np.atleast_1d(chosen)
        if rows.max(initial=-1) < fixed and columns.max(initial=-1) < fixed:
            values = self.fixed[np.ix_(chosen, rows, columns)]
        else:
            values = np.empty((len(chosen), len(rows), len(columns)))
            row_old, column_old = rows < fixed, columns < fixed
            old = np.ix_(chosen, rows[row_old], columns[column_old])
            values[np.ix_(np.arange(len(chosen)), row_old, column_old)] = self.fixed[old]
            new = np.ix_(chosen, rows, columns[~column_old] - fixed)
            values[:, :, ~column_old] = self.added[new]
            mirrored = np.ix_(chosen, columns[column_old], rows[~row_old] - fixed)
            values[np.ix_(np.arange(len(chosen)), ~row_old, column_old)] = self.added[mirrored].transpose(0, 2, 1)
        return values[0] if one else values

    def residual_products(self, block: int | slice | Places, columns: Places) -> Floats:
        """[columns] (or [blocks, columns]) products of columns with the measured residual."""
        return self.take(block, columns, np.array([self.y]))[..., 0]

    def residual_squares(self) -> Floats:
        """[blocks] sums of squares of the measured residual."""
        return self.fixed[:, self.y, self.y]

    def diagonal(self) -> Floats:
        """[blocks, columns] sums of squares of all columns."""
        fixed = np.einsum("bkk->bk", self.fixed)
        added = np.einsum("bkk->bk", self.added[:, self.y + 1 :])
        return np.concatenate([fixed, added], axis=1)

    def replaced(self, places: Places, products: list[Floats]) -> Gram:
        """With other values of added columns at `places`; `products` [columns, places] for every block.

        Indices behind the last column append columns.
        """
        fixed = self.y + 1
        size = max(self.size, int(places.max()) + 1)
        added = np.zeros((len(self.fixed), size, size - fixed))
        added[:, : self.size, : self.size - fixed] = self.added
        for number, values in enumerate(products):
            added[number][:, places - fixed] = values
            others = np.setdiff1d(np.arange(fixed, size), places)
            added[number][np.ix_(places, others - fixed)] = values[others].T
        return Gram(self.fixed, added)


@dataclass(frozen=True, slots=True)
class Blocks:
    """Gram matrices of all blocks."""

    white: Gram
    """Of whitened rows: what decides."""
    plain: Gram
    """Of rows in W: what an engineer calls the error."""
    rows: Floats
    """[blocks] number of white rows."""

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the regression, in the blocks where its gate is open."""

    place: int
    gate: Floats
    """[blocks] 0 or 1."""
    deviation: float = np.inf
    """Standard deviation of a normal prior about 0."""
    block_intercept: bool = False
    """Random intercept of a block: part of the noise, not of the prediction."""
    owner: str = ""
    """Key of the effect that the column belongs to; "" for the base model."""


@dataclass(frozen=True, slots=True)
class Competition:
    """Candidate columns under a gate, with the regression's own columns projected out."""

    schur: Floats
    """[c, c] Schur complement of the regression's block in the joint Gram matrix."""
    products: Floats
    """[c] products of the projected candidates with the residual."""
    projection: Floats
    """[own, c] coefficients of the candidates on the regression's columns."""
    beta: Floats
    """[own] coefficients without candidates."""


class Regression:
    """Columns that are free, with their priors, and the Gram matrices of the blocks."""

    def __init__(self, blocks: Blocks, columns: list[Column]) -> None:
        self.blocks, self.columns = blocks, columns
        self.places: Places = np.array([column.place for column in columns])
        self.gates: Floats = np.array([column.gate for column in columns])  # [own, blocks]
        self.precision = np.array([0.0 if np.isinf(c.deviation) else c.deviation**-2.0 for c in columns])
        self._normal: tuple[Floats, Floats] | None = None

    def on(self, blocks: Blocks) -> Regression:
        """The same columns on the blocks of a design with more columns, whose own columns have the same values."""
        assert blocks.white.fixed is self.blocks.white.fixed, "another design, or other rows"
        other = Regression(blocks, self.columns)
        self._block_products()
        other._normal = self._normal
        return other

    def with_columns(self, blocks: Blocks, columns: list[Column]) -> Regression:
        """The regression with more columns, on the blocks of a design that has them."""
        return Regression(blocks, [*self.columns, *columns])

    def without(self, owner: str) -> Regression:
        """The regression without the columns of an effect."""
        return Regression(self.blocks, [column for column in self.columns if column.owner != owner])

    def compete(self, candidates: Places, gate: Floats, weights: Floats | None = None) -> Competition:
        """Candidate columns under `gate` [blocks]; `weights` [blocks]: how often a block counts."""
        weights = np.ones(len(self.blocks)) if weights is None else weights
        gram = self.blocks.white
        A, b = self.normal(weights)
        weighted = weights * gate
        open_ = np.flatnonzero(weighted)
        Gcc = np.einsum("i,ijk->jk", weighted[open_], gram.take(open_, candidates, candidates), optimize=True)
        Gcy = np.einsum("i,ij->j", weighted[open_], gram.residual_products(open_, candidates), optimize=True)
        Gmc = np.zeros((len(self.places), len(candidates)))
        for i in open_:
            Gmc += weighted[i] * self.gates[:, i, None] * gram.take(int(i), self.places, candidates)
        factor = cho_factor(A)
        projection = cho_solve(factor, Gmc)
        beta = cho_solve(factor, b)
        return Competition(
            schur=Gcc - Gmc.T @ projection, products=Gcy - Gmc.T @ beta, projection=projection, beta=beta
        )

    def normal(self, weights: Floats) -> tuple[Floats, Floats]:
        """Normal matrix [own, own] and vector [own] with the priors, blocks weighted."""
        squares, products = self._block_products()
        A: Floats = np.einsum("i,ijk->jk", weights, squares, optimize=True)
        b: Floats = np.einsum("i,ij->j", weights, products)
        A[np.diag_indices(len(A))] += self.precision + 1e-9 * np.maximum(np.diag(A), 1e-9)
        return A, b

    def _block_products(self) -> tuple[Floats, Floats]:
        """[blocks, own, own] and [blocks, own] products of the gated columns, computed once."""
        if self._normal is None:
            gates, gram = self.gates.T, self.blocks.white
            squares = gram.take(slice(None), self.places, self.places)
            squares *= gates[:, :, None]  # in place: hours of recordings have a hundred blocks
            squares *= gates[:, None, :]
            self._normal = squares, gram.residual_products(slice(None), self.places) * gates
        return self._normal

    def solve(self) -> Floats:
        """[own] coefficients of all columns on all blocks."""
        A, b = self.normal(np.ones(len(self.blocks)))
        return np.asarray(cho_solve(cho_factor(A), b))

    def scores(self, competition: Competition, candidates: Places, gate: Floats) -> Floats:
        """[blocks, c] contributions of the blocks to `competition.products`."""
        gram = self.blocks.white
        scores = np.zeros((len(self.blocks), len(candidates)))
        beta, projection = competition.beta, competition.projection
        for i in range(len(self.blocks)):
            open_ = self.gates[:, i]
            own_products = gram.residual_products(i, self.places)
            own_left = open_ * (own_products - gram.take(i, self.places, self.places) @ (open_ * beta))
            scores[i] = -projection.T @ own_left
            if gate[i]:
                cross = gram.take(i, candidates, self.places)
                scores[i] += gate[i] * (gram.residual_products(i, candidates) - cross @ (open_ * beta))
        return scores

    def held_out_products(
        self, competition: Competition, candidates: Places, gate: Floats, blocks: Places, gram: Gram
    ) -> tuple[Floats, Floats]:
        """Gram matrix [c, c] of projected candidates and their products [c] with the residual, in held-out blocks.

        `competition`: a fit without those blocks; `gram`: white or plain.
        """
        Q, s = np.zeros_like(competition.schur), np.zeros(len(candidates))
        beta, projection = competition.beta, competition.projection
        for i in blocks.tolist():
            open_ = self.gates[:, i]
            square, cross_cm = gram.take(i, self.places, self.places), gram.take(i, candidates, self.places)
            left = gate[i] * (gram.residual_products(i, candidates) - cross_cm @ (open_ * beta))
            own_left = open_ * (gram.residual_products(i, self.places) - square @ (open_ * beta))
            s += left - projection.T @ own_left
            gated = open_[:, None] * projection
            cross = gate[i] * cross_cm @ gated
            Q += gate[i] * gram.take(i, candidates, candidates) - cross - cross.T + gated.T @ square @ gated
        return Q, s
