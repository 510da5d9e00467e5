"""The whitened design: columns and residuals of all blocks, and the Gram matrices of their white rows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.discrepancy.joints.observations import session_key
from acqd.discrepancy.joints.witness import Differences, Information, Witness
from acqd.discrepancy.regression.design_columns import Candidate, DesignColumns, Part
from acqd.discrepancy.regression.gram import Blocks, Gram, Indices, upper_triangle
from acqd.discrepancy.regression.white_rows import block_rows, by_noise, white_rows
from acqd.models.effects.places import Variant
from acqd.residual.whitening import Whitener

_PIECE = 384
"""Rows: fewer are too short for BLAS, and strides of a power of two displace each other in the cache."""


@dataclass(frozen=True, slots=True)
class Design:
    """Frozen: a method that changes something returns another design, which shares what is unchanged."""

    columns: DesignColumns
    whitener: Whitener
    slow_whitener: Whitener
    """The same noise with a longer memory: loads that switch every minute show only there."""
    trusted: tuple[NDArray[np.bool_], ...]
    """[rows] per block: False for outliers."""
    blocks: Blocks
    added: tuple[tuple[NDArray[np.float32], ...], ...] = ()
    """[T] per segment and column: those that were added to the design's own."""
    witness: Witness | None = None
    """Logged joint torques, if there are any on both sides."""

    @classmethod
    def of(
        cls,
        columns: DesignColumns,
        whitener: Whitener,
        slow_whitener: Whitener,
        trusted: tuple[NDArray[np.bool_], ...],
        products: list[Floats],
    ) -> Design:
        """Whitened by one noise model; `products`: `white_products` of every block, all of whose rows are trusted.

        They are the largest arrays beside the columns, and belong to the design from now on: those of other rows are
        replaced.
        """
        for number, (part, good) in enumerate(zip(columns.parts, trusted, strict=True)):
            if not good.all():
                products[number] = _products(columns, whitener, part, good)
        squares = np.array([_squares(columns, *each) for each in zip(columns.parts, trusted, strict=True)])
        gram = Gram.of(columns.values[0].shape[1], tuple(products))
        blocks = Blocks(gram, squares, np.array([float(good.sum()) for good in trusted]))
        return cls(columns, whitener, slow_whitener, trusted, blocks, tuple(() for _ in columns.residual))

    @property
    def parts(self) -> tuple[Part, ...]:
        """Blocks of rows."""
        return self.columns.parts

    def values(self, segment: int, indices: Indices, rows: slice = slice(None)) -> Floats:
        """[rows, k] W of some columns in a segment, or in part of a segment."""
        y = self.blocks.white.y
        own = self.columns.values[segment][rows]
        values = np.empty((len(own), len(indices)))
        added = indices > y
        values[:, ~added] = own[:, indices[~added]]
        for k in np.flatnonzero(added).tolist():
            values[:, k] = self.added[segment][int(indices[k]) - y - 1][rows]
        return values

    def added_columns(self) -> list[Floats]:
        """[T, e] W of all added columns, per segment; there has to be one."""
        return [np.column_stack(values).astype(np.float64) for values in self.added]

    def power(self, segment: int, indices: Indices, weights: Floats, rows: slice) -> Floats:
        """[rows] W of the sum of many columns with weights [k], in the single precision of the columns.

        Whole rows are multiplied: to gather some columns of every row would take longer.
        """
        y = self.blocks.white.y
        of_all = np.bincount(indices, weights, self.blocks.white.size).astype(np.float32)
        with np.errstate(invalid="ignore"):  # OpenBLAS raises the flag of finite numbers, too (numpy issue 24067)
            power = self.columns.values[segment][rows] @ of_all[:y]
        for weight, values in zip(of_all[y + 1 :], self.added[segment], strict=True):
            if weight:
                power += weight * values[rows]
        return np.asarray(power, dtype=np.float64)

    def at_joints(self, candidate: Candidate, weights: Floats) -> Information | None:
        """What logged torques say about a candidate; `weights` [blocks]: how often a block counts. None: nothing."""
        asked = self._asked_of_joints(candidate)
        if asked is None:
            return None
        witness, variant = asked
        return witness.information(
            candidate.id, variant, self._sessions_at_joints(weights), scanned=candidate.fitted is None
        )

    def differences_at_joints(self, candidate: Candidate, weights: Floats, coefficients: Floats) -> Differences | None:
        """What unchanged sessions differ by in torques, in units of `coefficients`; as `at_joints`."""
        asked = self._asked_of_joints(candidate)
        if asked is None:
            return None
        witness, variant = asked
        return witness.differences(
            candidate.id, variant, self._sessions_at_joints(weights), coefficients, scanned=candidate.fitted is None
        )

    def _asked_of_joints(self, candidate: Candidate) -> tuple[Witness, Variant] | None:
        witness, variant = self.witness, candidate.fitted or candidate.variant
        if witness is None or variant is None or candidate.detected or not witness.sees(candidate.id):
            return None
        return witness, variant

    def _sessions_at_joints(self, weights: Floats) -> dict[str, float]:
        """How often a session in question counts, by its name; `weights` [blocks]."""
        shares: dict[str, list[float]] = {}
        for part, weight in zip(self.parts, weights, strict=True):
            if part.in_question:
                shares.setdefault(session_key(part.recording, in_question=True), []).append(float(weight))
        return {name: float(np.mean(each)) for name, each in shares.items()}

    def with_trusted(self, trusted: tuple[NDArray[np.bool_], ...]) -> Design:
        """With other trusted rows; Gram matrices of blocks where other rows are trusted are computed again."""
        y = self.blocks.white.y
        white, squares = list(self.blocks.white.fixed), self.blocks.squares[:, : y + 1].copy()
        for number, (part, good) in enumerate(zip(self.parts, trusted, strict=True)):
            if np.array_equal(good, self.trusted[number]):
                continue
            white[number] = _products(self.columns, self.whitener, part, good)
            squares[number] = _squares(self.columns, part, good)
        counts = np.array([int(good.sum()) for good in trusted], dtype=float)
        design = replace(self, trusted=trusted, blocks=Blocks(Gram.of(y, tuple(white)), squares, counts))
        if not self.added[0]:
            return design
        return design.with_replaced(np.arange(len(self.added[0])) + y + 1, self.added_columns())

    def with_columns(self, columns: list[Floats]) -> tuple[Design, Indices]:
        """The design with more columns ([T, k] W per segment), and their indices."""
        size = self.blocks.white.size
        indices = np.arange(size, size + columns[0].shape[1])
        return self.with_replaced(indices, columns), indices

    def with_replaced(self, indices: Indices, columns: list[Floats]) -> Design:
        """The design with other values ([T, k] W per segment) of added columns; new indices append columns."""
        size = max(self.blocks.white.size, int(indices.max()) + 1)
        own = indices - self.blocks.white.y - 1
        added = tuple(_with_values(old, own, values) for old, values in zip(self.added, columns, strict=True))
        products: list[Floats] = []
        squares = np.zeros((len(self.parts), size))
        squares[:, : self.blocks.white.size] = self.blocks.squares
        for number, (part, good) in enumerate(zip(self.parts, self.trusted, strict=True)):
            values = np.column_stack([added[part.segment][k][part.rows] for k in own]).astype(np.float64)
            if not values.any():
                products.append(np.zeros((size, len(indices))))
                squares[number, indices] = 0.0
                continue
            everything = (
                self.columns.values[part.segment][part.rows],
                self.columns.residual[part.segment][part.rows, None],
                np.column_stack([each[part.rows] for each in added[part.segment]]),
            )
            white = white_rows(self.whitener, part, values) * good[:, None]
            white = self.whitener.back(by_noise(part, white), past=part.past > 0)
            products.append(np.concatenate([_crossed(each, white) for each in everything]))
            if part.in_question:
                squares[number, indices] = (values[part.past :][good] ** 2).sum(axis=0)
        blocks = Blocks(self.blocks.white.replaced(indices, products), squares, self.blocks.rows)
        return replace(self, added=added, blocks=blocks)


def _crossed(rows: NDArray[Any], white: Floats) -> Floats:
    """rows.T @ white [p, k] in double precision; a piece at a time, so that its copy stays in the processor's cache."""
    total = np.zeros((white.shape[1], rows.shape[1]))
    for first in range(0, len(rows), _PIECE):
        piece = slice(first, first + _PIECE)
        total += white[piece].T @ rows[piece].astype(np.float64)
    return total.T


def _products(columns: DesignColumns, whitener: Whitener, part: Part, good: NDArray[np.bool_]) -> Floats:
    """Upper triangle of the products [p + 1, p + 1] of a block's good white rows."""
    known = white_rows(whitener, part, block_rows(columns, part))[good]
    return upper_triangle(known.T @ known)


def _squares(columns: DesignColumns, part: Part, good: NDArray[np.bool_]) -> Floats:
    """[p + 1] W^2: sums over good rows; 0 of a block that is not in question."""
    if not part.in_question:
        return np.zeros(columns.values[0].shape[1] + 1)
    rows = block_rows(columns, part)[part.past :][good]
    return np.asarray(np.einsum("tk,tk->k", rows, rows, dtype=np.float64))


def _with_values(
    old: tuple[NDArray[np.float32], ...], at: Indices, values: NDArray[Any]
) -> tuple[NDArray[np.float32], ...]:
    """Added columns [T], some with other values [T, k]; zeros, of the side without such an effect, take no memory."""
    columns = list(old)
    columns += [np.empty(0, dtype=np.float32)] * (int(at.max()) + 1 - len(columns))
    for k, number in enumerate(at.tolist()):
        column = values[:, k]
        columns[number] = column.astype(np.float32) if column.any() else _zeros(len(column))
    return tuple(columns)


def _zeros(rows: int) -> NDArray[np.float32]:
    return np.broadcast_to(np.zeros(1, dtype=np.float32), (rows,))
