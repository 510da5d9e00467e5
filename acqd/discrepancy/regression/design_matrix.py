"""The whitened design: columns and residuals of all blocks, and the Gram matrices of their white rows."""

from __future__ import annotations

from collections.abc import Sequence
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

_PIECE = 128
"""Rows."""


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
    added: tuple[NDArray[np.float32], ...] = ()
    """[T, e] per segment: columns that were added to the design's own."""
    witness: Witness | None = None
    """Logged joint torques, if there are any on both sides."""

    @classmethod
    def of(
        cls,
        columns: DesignColumns,
        whitener: Whitener,
        slow_whitener: Whitener,
        trusted: tuple[NDArray[np.bool_], ...],
        products: Sequence[Floats],
    ) -> Design:
        """Whitened by one noise model; `products`: `white_products` of every block, all of whose rows are trusted.

        They are the largest arrays beside the columns, and belong to the design from now on.
        """
        y = columns.values[0].shape[1]
        white = tuple(products)
        squares = np.array([_squares(columns, part, np.s_[:]) for part in columns.parts])
        empty = np.empty((len(products), y + 1, 0))
        everywhere = tuple(np.ones(len(good), dtype=bool) for good in trusted)
        design = cls(
            columns, whitener, slow_whitener, everywhere,
            Blocks(Gram(y, white, empty), squares, np.array([float(len(good)) for good in trusted])),
            tuple(np.empty((len(residual), 0), dtype=np.float32) for residual in columns.residual),
        )  # fmt: skip
        return design.with_trusted(trusted)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Blocks of rows."""
        return self.columns.parts

    def values(self, segment: int, indices: Indices, rows: slice = slice(None)) -> Floats:
        """[rows, k] W of some columns in a segment, or in part of a segment."""
        y = self.blocks.white.y
        own, more = self.columns.values[segment][rows], self.added[segment][rows]
        values = np.empty((len(own), len(indices)))
        added = indices > y
        values[:, ~added] = own[:, indices[~added]]
        values[:, added] = more[:, indices[added] - y - 1]
        return values

    def power(self, segment: int, indices: Indices, weights: Floats, rows: slice) -> Floats:
        """[rows] W of the sum of many columns with weights [k], in the single precision of the columns.

        Whole rows are multiplied: to gather some columns of every row would take longer.
        """
        y = self.blocks.white.y
        of_all = np.bincount(indices, weights, self.blocks.white.size).astype(np.float32)
        own, more = self.columns.values[segment][rows], self.added[segment][rows]
        with np.errstate(invalid="ignore"):  # OpenBLAS raises the flag of finite numbers, too (numpy issue 24067)
            return np.asarray(own @ of_all[:y] + more @ of_all[y + 1 :], dtype=np.float64)

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
            known = white_rows(self.whitener, part, block_rows(self.columns, part))[good]
            white[number] = upper_triangle(known.T @ known)
            squares[number] = _squares(self.columns, part, good)
        counts = np.array([int(good.sum()) for good in trusted], dtype=float)
        empty = np.empty((len(trusted), y + 1, 0))
        blocks = Blocks(Gram(y, tuple(white), empty), squares, counts)
        design = replace(self, trusted=trusted, blocks=blocks)
        if not self.added[0].shape[1]:
            return design
        indices = np.arange(self.added[0].shape[1]) + y + 1
        return design.with_replaced(indices, [values.astype(np.float64) for values in self.added])

    def with_columns(self, columns: list[Floats]) -> tuple[Design, Indices]:
        """The design with more columns ([T, k] W per segment), and their indices."""
        size = self.blocks.white.size
        indices = np.arange(size, size + columns[0].shape[1])
        return self.with_replaced(indices, columns), indices

    def with_replaced(self, indices: Indices, columns: list[Floats]) -> Design:
        """The design with other values ([T, k] W per segment) of added columns; new indices append columns."""
        first = self.blocks.white.y + 1
        size = max(self.blocks.white.size, int(indices.max()) + 1)
        own = indices - first
        added = tuple(_grown(old, size - first, own, values) for old, values in zip(self.added, columns, strict=True))
        products: list[Floats] = []
        squares = np.zeros((len(self.parts), size))
        squares[:, : self.blocks.white.size] = self.blocks.squares
        for number, (part, good) in enumerate(zip(self.parts, self.trusted, strict=True)):
            values = added[part.segment][part.rows][:, own].astype(np.float64)
            if not values.any():
                products.append(np.zeros((size, len(indices))))
                squares[number, indices] = 0.0
                continue
            everything = (
                self.columns.values[part.segment],
                self.columns.residual[part.segment][:, None],
                added[part.segment],
            )
            white = white_rows(self.whitener, part, values) * good[:, None]
            white = self.whitener.back(by_noise(part, white), past=part.past > 0)
            products.append(np.concatenate([_crossed(each[part.rows], white) for each in everything]))
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


def _squares(columns: DesignColumns, part: Part, good: slice | NDArray[np.bool_]) -> Floats:
    """[p + 1] W^2: sums over good rows; 0 of a block that is not in question."""
    if not part.in_question:
        return np.zeros(columns.values[0].shape[1] + 1)
    rows = block_rows(columns, part)[part.past :][good]
    return np.asarray(np.einsum("tk,tk->k", rows, rows, dtype=np.float64))


def _grown(old: NDArray[np.float32], width: int, at: Indices, values: NDArray[Any]) -> NDArray[np.float32]:
    if not values.any() and not old.any():  # one side of an effect that only the other one has: takes no memory
        return np.broadcast_to(np.zeros(1, dtype=np.float32), (len(old), width))
    grown = np.zeros((len(old), width), dtype=np.float32)
    grown[:, : old.shape[1]] = old
    grown[:, at] = values
    return grown
