"""Least squares over white rows, kept as one Gram matrix per block, so that every question costs milliseconds.

A block is a recording, or part of a long one: the unit of cross-validation and of the bootstrap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from acqd.arrays import Floats


@dataclass(slots=True)
class Blocks:
    """Gram matrices of raw columns; the last one is the measured residual of the model as it was."""

    grams: Floats
    """[blocks, p + 1, p + 1]."""
    rows: Floats
    """[blocks] white rows."""
    plain: Floats
    """The same Gram matrices of rows that were not whitened: what an engineer calls the error."""

    @property
    def y(self) -> int:
        """Place of the residual."""
        return int(self.grams.shape[1]) - 1

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, slots=True)
class Column:
    """A raw column where its gate is open."""

    place: int
    gate: Floats
    """[blocks] 0 or 1."""
    deviation: float = np.inf
    """Of a prior around 0."""
    block_intercept: bool = False
    """A block's own level: part of the noise, not of what is known."""


@dataclass(slots=True)
class Competition:
    """Candidates under one gate beside everything that is in the model already, blocks weighted."""

    S: Floats
    """[c, c] what is left of the candidates' Gram when the model has taken its part."""
    r: Floats
    """[c] and of their products with the residual."""
    rest: float
    """White sum of squares that the model leaves."""
    projection: Floats
    """[model, c] how much of each candidate the model takes over."""
    beta: Floats
    """[model] coefficients without candidates."""


class Model:
    """The columns that are free, and the blocks."""

    def __init__(self, blocks: Blocks, columns: list[Column]) -> None:
        self.blocks, self.columns = blocks, columns
        self.places = np.array([column.place for column in columns])
        self.gates = np.array([column.gate for column in columns])  # [model, blocks]
        self.ridge = np.array([0.0 if np.isinf(c.deviation) else c.deviation**-2.0 for c in columns])
        self._own: tuple[Floats, Floats] | None = None

    def compete(self, candidates: NDArray[np.int64], gate: Floats, weights: Floats | None = None) -> Competition:
        """Candidates (raw places) under `gate` [blocks]; `weights` [blocks] count blocks several times or not."""
        weights = np.ones(len(self.blocks)) if weights is None else weights
        grams, y = self.blocks.grams, self.blocks.y
        A, b, total = self.normal(weights)
        weighted = weights * gate
        open_ = np.flatnonzero(weighted)
        Gcc = np.einsum("i,ijk->jk", weighted[open_], grams[np.ix_(open_, candidates, candidates)], optimize=True)
        Gcy = np.einsum("i,ij->j", weighted[open_], grams[open_][:, candidates, y], optimize=True)
        Gmc = np.zeros((len(self.places), len(candidates)))
        for i in open_:
            Gmc += weighted[i] * self.gates[:, i, None] * grams[i][np.ix_(self.places, candidates)]
        factor = cho_factor(A)
        projection = cho_solve(factor, Gmc)
        beta = cho_solve(factor, b)
        S = Gcc - Gmc.T @ projection
        return Competition(S, Gcy - Gmc.T @ beta, float(total - b @ beta), projection, beta)

    def normal(self, weights: Floats) -> tuple[Floats, Floats, float]:
        """Normal matrix and vector with the priors, and the white sum of squares; blocks weighted."""
        grams, y = self.blocks.grams, self.blocks.y
        if self._own is None:
            gates = self.gates.T
            squares = grams[:, self.places[:, None], self.places] * gates[:, :, None] * gates[:, None, :]
            self._own = squares, grams[:, self.places, y] * gates
        A: Floats = np.einsum("i,ijk->jk", weights, self._own[0], optimize=True)
        b: Floats = np.einsum("i,ij->j", weights, self._own[1])
        A[np.diag_indices(len(A))] += self.ridge + 1e-9 * np.maximum(np.diag(A), 1e-9)
        return A, b, float(weights @ grams[:, y, y])

    def solve(self) -> Floats:
        """Coefficients."""
        A, b, _ = self.normal(np.ones(len(self.blocks)))
        return np.asarray(cho_solve(cho_factor(A), b))

    def scores(self, competition: Competition, candidates: NDArray[np.int64], gate: Floats) -> Floats:
        """[blocks, c] what each block says of candidates that the model does not take over; they add up to r."""
        grams, y = self.blocks.grams, self.blocks.y
        found = np.zeros((len(self.blocks), len(candidates)))
        beta, projection = competition.beta, competition.projection
        for i in range(len(self.blocks)):
            own = self.gates[:, i]
            left_m = own * (grams[i][self.places, y] - grams[i][np.ix_(self.places, self.places)] @ (own * beta))
            found[i] = -projection.T @ left_m
            if gate[i]:
                left_c = grams[i][candidates, y] - grams[i][np.ix_(candidates, self.places)] @ (own * beta)
                found[i] += gate[i] * left_c
        return found

    def held_out_products(
        self, found: Competition, candidates: NDArray[np.int64], gate: Floats, blocks: NDArray[np.int64], grams: Floats
    ) -> tuple[Floats, Floats]:
        """Candidates' Gram [c, c] and products with the residual [c] in some blocks, by a fit that has not seen them.

        `grams`: white or plain ones.
        """
        y, at = self.blocks.y, self.places
        Q, s = np.zeros_like(found.S), np.zeros(len(candidates))
        for i in blocks:
            g, own = grams[i], self.gates[:, i]
            square, cross_mc = g[np.ix_(at, at)], g[np.ix_(candidates, at)]
            left = gate[i] * (g[candidates, y] - cross_mc @ (own * found.beta))
            left_m = own * (g[at, y] - square @ (own * found.beta))
            s += left - found.projection.T @ left_m
            projection = own[:, None] * found.projection
            cross = gate[i] * cross_mc @ projection
            Q += gate[i] * g[np.ix_(candidates, candidates)] - cross - cross.T + projection.T @ square @ projection
        return Q, s
