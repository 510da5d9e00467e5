"""Generalised least squares of columns with priors, and what candidates explain beyond them: Schur complements.

All sums are over Gram matrices of blocks; a block without a weight, or outside of a column's gate, does not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from acqd.arrays import Floats
from acqd.discrepancy.regression.gram import Blocks, Indices

LEAST_POWER = 1e-3
"""White squared error: columns below never act, or the regression has them already."""
_ROUNDING = 1e-12
"""Of sums over hundreds of blocks, with a margin."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the regression, in the blocks where its gate is open."""

    index: int
    """Of the design's columns."""
    gate: Floats
    """[blocks] 0 or 1."""
    deviation: float = np.inf
    """Standard deviation of a normal prior."""
    mean: float = 0.0
    """Of the prior."""
    block_intercept: bool = False
    """Random intercept of a block: part of the noise, not of the prediction."""
    owner: str = ""
    """Key of the effect that the column belongs to; "" for the base model."""
    varies: str = ""
    """Key of the effect whose size the column varies in one log; "" for none."""


@dataclass(frozen=True, slots=True)
class Competition:
    """Candidate columns under a gate, with the regression's columns projected out."""

    schur: Floats
    """[c, c] Schur complement of the regression's block in the joint Gram matrix."""
    products: Floats
    """[c] products of the projected candidates with the residual."""
    projection: Floats
    """[columns, c] coefficients of the candidates on the regression's columns."""
    beta: Floats
    """[columns] coefficients without candidates."""


@dataclass(frozen=True, slots=True)
class Moments:
    """What blocks say of columns, whatever their power is: products of the regression's columns and of candidates."""

    normal: Floats
    """[columns, columns] without priors."""
    cross: Floats
    """[columns, c]."""
    squares: Floats
    """[c, c]."""

    def times(self, weight: float) -> Moments:
        """Of blocks that count so often."""
        return Moments(weight * self.normal, weight * self.cross, weight * self.squares)


@dataclass(slots=True)
class _Cross:
    """Sums of products of candidates over blocks."""

    squares: Floats
    """[c, c]."""
    products: Floats
    """[c] with the residual."""
    columns: Floats
    """[columns, c] with the regression's columns."""

    def copy(self) -> _Cross:
        """Another one with the same values."""
        return _Cross(self.squares.copy(), self.products.copy(), self.columns.copy())


class Regression:
    """Columns that are free, with their priors, and the Gram matrices of the blocks."""

    def __init__(self, blocks: Blocks, columns: list[Column]) -> None:
        self.blocks, self.columns = blocks, columns
        self.indices: Indices = np.array([column.index for column in columns])
        self.gates: Floats = np.array([column.gate for column in columns])  # [columns, blocks]
        self.precision = np.array([0.0 if np.isinf(c.deviation) else c.deviation**-2.0 for c in columns])
        self._pull = self.precision * np.array([c.mean for c in columns])
        self._normal: tuple[Floats, Floats] | None = None  # of all blocks
        self._fewer: tuple[Floats, Floats] | None = None  # of all blocks, of the first columns
        self._crossed: tuple[Indices, Floats, _Cross] | None = None  # of all blocks: candidates, gate, sums
        self._latest: tuple[Floats, tuple[Floats, bool], Floats] | None = None  # weights, factor, coefficients

    def on(self, blocks: Blocks) -> Regression:
        """The same columns on the blocks of a design with more columns, whose own columns have the same values."""
        assert blocks.white.fixed is self.blocks.white.fixed, "another design, or other rows"
        other = Regression(blocks, self.columns)
        other._normal, other._latest = self._normal, self._latest
        return other

    def with_columns(self, blocks: Blocks, columns: list[Column]) -> Regression:
        """The regression with more columns, on the blocks of a design that has them.

        As for `on`, the columns of this regression have the same values there: their products are not computed again.
        Where other rows are trusted, all are.
        """
        other = Regression(blocks, [*self.columns, *columns])
        other._fewer = self._normal if blocks.white.fixed is self.blocks.white.fixed else None
        return other

    def without(self, owner: str) -> Regression:
        """The regression without the columns of an effect, and without those that vary its size."""
        left = [k for k, each in enumerate(self.columns) if owner not in (each.owner, each.varies)]
        other = Regression(self.blocks, [self.columns[k] for k in left])
        if self._normal is not None:
            other._normal = self._normal[0][np.ix_(left, left)], self._normal[1][left]
        return other

    def compete(self, candidates: Indices, gate: Floats, weights: Floats | None = None) -> Competition:
        """Candidate columns under `gate` [blocks]; `weights` [blocks]: how often a block counts."""
        weights = np.ones(len(self.blocks)) if weights is None else weights
        factor, beta = self._solved(weights)
        cross = self._cross(candidates, gate, weights)
        projection = cho_solve(factor, cross.columns)
        return Competition(
            schur=cross.squares - cross.columns.T @ projection, products=cross.products - cross.columns.T @ beta,
            projection=projection, beta=beta,
        )  # fmt: skip

    def moments(self, candidates: Indices, gate: Floats, weights: Floats) -> Moments:
        """Sums over weighted blocks; candidates count under `gate` [blocks]. Sums of several sets of blocks add."""
        cross = self._add_cross(None, candidates, gate * weights)
        return Moments(self._add_normal(None, weights)[0], cross.columns, cross.squares)

    def _solved(self, weights: Floats) -> tuple[tuple[Floats, bool], Floats]:
        """Cholesky factor of the normal matrix, and the coefficients; those of the latest weights are kept."""
        if self._latest is None or not np.array_equal(self._latest[0], weights):
            A, b = self.normal(weights)
            factor = cho_factor(A)
            self._latest = weights.copy(), factor, np.asarray(cho_solve(factor, b))
        return self._latest[1:]

    def _cross(self, candidates: Indices, gate: Floats, weights: Floats) -> _Cross:
        """Products of candidates under a gate, blocks weighted."""
        open_ = gate != 0
        changed = np.flatnonzero(open_ & (weights != 1))
        if 2 * len(changed) >= np.count_nonzero(open_):
            return self._add_cross(None, candidates, gate * weights)
        known = self._crossed
        if known is None or not (np.array_equal(known[0], candidates) and np.array_equal(known[1], gate)):
            known = self._crossed = candidates, gate, self._add_cross(None, candidates, gate)
        # without a recording: all but its blocks, which are few
        return self._add_cross(known[2].copy(), candidates, gate * (weights - 1)) if len(changed) else known[2]

    def _add_cross(self, to: _Cross | None, candidates: Indices, weighted: Floats) -> _Cross:
        gram, c = self.blocks.white, len(candidates)
        cross = to or _Cross(np.zeros((c, c)), np.zeros(c), np.zeros((len(self.indices), c)))
        for i in np.flatnonzero(weighted).tolist():
            cross.squares += weighted[i] * gram.take(i, candidates, candidates)
            cross.products += weighted[i] * gram.residual_products(i, candidates)
            active = np.flatnonzero(self.gates[:, i])
            cross.columns[active] += (
                weighted[i] * self.gates[active, i, None] * gram.take(i, self.indices[active], candidates)
            )
        return cross

    def normal(self, weights: Floats) -> tuple[Floats, Floats]:
        """Normal matrix [columns, columns] and vector [columns] with the priors, blocks weighted."""
        changed = np.count_nonzero(weights != 1)
        if 2 * changed >= len(weights):
            A, b = self._add_normal(None, weights)
        else:
            if self._normal is None:
                self._normal = self._all_normal()
            A, b = self._add_normal(self._normal, weights - 1)
            if changed:  # what the other blocks hold was taken away, but for its rounding errors
                A[np.diag_indices(len(A))] += _ROUNDING * np.diag(self._normal[0])
        A[np.diag_indices(len(A))] += self.precision + 1e-9 * np.maximum(np.diag(A), 1e-9)
        return A, b + self._pull

    def _all_normal(self) -> tuple[Floats, Floats]:
        """Of all blocks; products of columns that a smaller regression had are known."""
        if self._fewer is None:
            return self._add_normal(None, np.ones(len(self.blocks)))
        gram, size, known = self.blocks.white, len(self.columns), len(self._fewer[1])
        A, b = np.zeros((size, size)), np.zeros(size)
        A[:known, :known], b[:known] = self._fewer
        for i in range(len(self.blocks)):
            active, new = (np.flatnonzero(self.gates[first:, i]) + first for first in (0, known))
            if not len(new):
                continue
            products = gram.take(i, self.indices[active], self.indices[new])
            A[active[:, None], new] += products * np.outer(self.gates[active, i], self.gates[new, i])
            b[new] += gram.residual_products(i, self.indices[new]) * self.gates[new, i]
        A[known:, :known] = A[:known, known:].T
        return A, b

    def _add_normal(self, to: tuple[Floats, Floats] | None, weights: Floats) -> tuple[Floats, Floats]:
        size = len(self.columns)
        A, b = (np.zeros((size, size)), np.zeros(size)) if to is None else (to[0].copy(), to[1].copy())
        for i in np.flatnonzero(weights).tolist():
            active, squares, products = self._open_in(i)
            A[np.ix_(active, active)] += weights[i] * squares
            b[active] += weights[i] * products
        return A, b

    def _open_in(self, block: int) -> tuple[Indices, Floats, Floats]:
        """Columns [o] that are open in a block, their products [o, o], and those with the residual [o].

        A random intercept is open in one block only: a hundred blocks have a hundred of them. Not kept:
        the products of an hour's blocks are larger than what they save.
        """
        gram = self.blocks.white
        active = np.flatnonzero(self.gates[:, block])
        gates, indices = self.gates[active, block], self.indices[active]
        squares = gram.take(block, indices, indices) * np.outer(gates, gates)
        return active, squares, gram.residual_products(block, indices) * gates

    def solve(self) -> Floats:
        """[columns] coefficients of all columns on all blocks."""
        A, b = self.normal(np.ones(len(self.blocks)))
        return np.asarray(cho_solve(cho_factor(A), b))

    def scores(self, competition: Competition, candidates: Indices, gate: Floats) -> Floats:
        """[blocks, c] contributions of the blocks to `competition.products`."""
        gram = self.blocks.white
        scores = np.zeros((len(self.blocks), len(candidates)))
        beta, projection = competition.beta, competition.projection
        for i in range(len(self.blocks)):
            active, squares, products = self._open_in(i)
            inside = beta[active]
            scores[i] = -projection[active].T @ (products - squares @ inside)
            if gate[i]:
                cross = gram.take(i, candidates, self.indices[active])
                left = gram.residual_products(i, candidates) - cross @ (self.gates[active, i] * inside)
                scores[i] += gate[i] * left
        return scores

    def products_in(
        self, competition: Competition, candidates: Indices, gate: Floats, blocks: Indices
    ) -> tuple[Floats, Floats]:
        """Gram matrix [c, c] of projected candidates and their products [c] with the residual, in some blocks."""
        gram = self.blocks.white
        Q, s = np.zeros_like(competition.schur), np.zeros(len(candidates))
        beta, projection = competition.beta, competition.projection
        for i in blocks.tolist():
            active = np.flatnonzero(self.gates[:, i])
            gates, indices = self.gates[active, i], self.indices[active]
            square, cross_cm = gram.take(i, indices, indices), gram.take(i, candidates, indices)
            left = gate[i] * (gram.residual_products(i, candidates) - cross_cm @ (gates * beta[active]))
            column_left = gates * (gram.residual_products(i, indices) - square @ (gates * beta[active]))
            s += left - projection[active].T @ column_left
            gated = gates[:, None] * projection[active]
            cross = gate[i] * cross_cm @ gated
            Q += gate[i] * gram.take(i, candidates, candidates) - cross - cross.T + gated.T @ square @ gated
        return Q, s
