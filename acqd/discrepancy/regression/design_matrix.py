"""The whitened design: columns and residuals of all blocks as white rows, and their Gram matrices."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.discrepancy.joints.observations import session_key
from acqd.discrepancy.joints.witness import Information, Witness
from acqd.discrepancy.regression.design_columns import Candidate, DesignColumns, Part
from acqd.discrepancy.regression.gram import Blocks, Gram, Places
from acqd.discrepancy.residual.whitening import Whitener
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.numerics import mad_sigma


@dataclass(frozen=True, slots=True)
class Design:
    """Frozen: a method that changes something returns another design, which shares what is unchanged."""

    columns: DesignColumns
    whitener: Whitener
    slow_whitener: Whitener
    """The same noise with a longer memory: loads that switch every minute show only there."""
    white: tuple[NDArray[np.float32], ...]
    """[rows, p + 1] per block: columns and residual."""
    trusted: tuple[NDArray[np.bool_], ...]
    """[rows] per block: False for outliers."""
    blocks: Blocks
    added: tuple[NDArray[np.float32], ...] = ()
    """[T, e] per segment: columns that were added to the design's own."""
    added_white: tuple[NDArray[np.float32], ...] = ()
    """[rows, e] per block."""
    witness: Witness | None = None
    """Logged joint torques, if there are any on both sides."""

    @classmethod
    def of(cls, columns: DesignColumns, whitener: Whitener, slow_whitener: Whitener | None = None) -> Design:
        """Whitened by one noise model; all rows are trusted."""
        white = tuple(_whitened(whitener, part, _block(columns, part)) for part in columns.parts)
        trusted = tuple(np.ones(len(rows), dtype=bool) for rows in white)
        nothing = Gram(np.empty((0, 1, 1)), np.empty((0, 1, 0)))
        design = cls(
            columns, whitener, slow_whitener or whitener, white, trusted, Blocks(nothing, nothing, np.empty(0)),
            tuple(np.empty((len(residual), 0), dtype=np.float32) for residual in columns.residual),
            tuple(np.empty((len(rows), 0), dtype=np.float32) for rows in white),
        )  # fmt: skip
        return design.with_trusted(trusted)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Blocks of rows."""
        return self.columns.parts

    def values(self, segment: int, places: Places, rows: slice = slice(None)) -> Floats:
        """[rows, k] W of some columns in a segment, or in part of a segment."""
        y = self.blocks.white.y
        own, more = self.columns.values[segment][rows], self.added[segment][rows]
        values = np.empty((len(own), len(places)))
        added = places > y
        values[:, ~added] = own[:, places[~added]]
        values[:, added] = more[:, places[added] - y - 1]
        return values

    def at_joints(self, candidate: Candidate, weights: Floats) -> Information | None:
        """What logged torques say about a candidate; `weights` [blocks]: how often a block counts. None: nothing."""
        witness, variant = self.witness, candidate.fitted or candidate.variant
        if witness is None or variant is None or candidate.detected or not witness.sees(candidate.id):
            return None
        shares: dict[str, list[float]] = {}
        for part, weight in zip(self.parts, weights, strict=True):
            if part.in_question:
                shares.setdefault(session_key(part.recording, in_question=True), []).append(float(weight))
        sessions = {name: float(np.mean(each)) for name, each in shares.items()}
        return witness.information(candidate.id, variant, sessions, scanned=candidate.fitted is None)

    def with_trusted(self, trusted: tuple[NDArray[np.bool_], ...]) -> Design:
        """With other trusted rows; all Gram matrices are computed again."""
        size = self.white[0].shape[1]
        white, plain = (np.empty((len(trusted), size, size)) for _ in range(2))
        for number, (part, rows, good) in enumerate(zip(self.parts, self.white, trusted, strict=True)):
            for values, grams in ((rows, white), (_block(self.columns, part)[part.past :], plain)):
                exact = values[good].astype(np.float64)
                np.matmul(exact.T, exact, out=grams[number])
        counts = np.array([int(good.sum()) for good in trusted], dtype=float)
        empty = np.empty((len(white), size, 0))
        blocks = Blocks(Gram(white, empty), Gram(plain, empty), counts)
        design = replace(self, trusted=trusted, blocks=blocks)
        if not self.added[0].shape[1]:
            return design
        places = np.arange(self.added[0].shape[1]) + blocks.white.y + 1
        return design.with_replaced(places, [values.astype(np.float64) for values in self.added])

    def without_outliers(self, fits: list[Floats]) -> Design:
        """Without rows that are outliers even of a fit of everything; `fits`: [p] coefficients per block.

        A protective stop or a collision says nothing about an effect, and a few such rows outweigh hours.
        """
        left = [white[:, -1] - white[:, :-1] @ beta for white, beta in zip(self.white, fits, strict=True)]
        spread = mad_sigma(np.concatenate(left), 0.0) + 1e-9
        near = [np.abs(rows) < THRESHOLDS.outlier * spread for rows in left]
        return self.with_trusted(tuple(n & known for n, known in zip(near, self.trusted, strict=True)))

    def with_columns(self, columns: list[Floats]) -> tuple[Design, Places]:
        """The design with more columns ([T, k] W per segment), and their indices."""
        size = self.blocks.white.size
        places = np.arange(size, size + columns[0].shape[1])
        return self.with_replaced(places, columns), places

    def with_replaced(self, places: Places, columns: list[Floats]) -> Design:
        """The design with other values ([T, k] W per segment) of added columns; new indices append columns."""
        first = self.blocks.white.y + 1
        size = max(self.blocks.white.size, int(places.max()) + 1)
        own = places - first
        added = [_grown(old, size - first, own, values) for old, values in zip(self.added, columns, strict=True)]
        white: list[NDArray[np.float32]] = []
        products: tuple[list[Floats], list[Floats]] = ([], [])
        for number, part in enumerate(self.parts):
            values = columns[part.segment][part.rows]
            silent = not values.any()
            rows = np.zeros_like(values[part.past :]) if silent else _whitened(self.whitener, part, values)
            white.append(_grown(self.added_white[number], size - first, own, rows))
            if silent:
                for grams in products:
                    grams.append(np.zeros((size, len(places))))
                continue
            good = self.trusted[number]
            everything = np.concatenate([self.white[number], white[-1]], axis=1)[good].astype(np.float64)
            products[0].append(everything.T @ white[-1][good][:, own].astype(np.float64))
            block = np.concatenate([_block(self.columns, part), added[part.segment][part.rows]], axis=1)
            everything = block[part.past :][good].astype(np.float64)
            products[1].append(everything.T @ values[part.past :][good])
        blocks = Blocks(
            self.blocks.white.replaced(places, products[0]), self.blocks.plain.replaced(places, products[1]),
            self.blocks.rows,
        )  # fmt: skip
        return replace(self, added=tuple(added), added_white=tuple(white), blocks=blocks)


def _grown(old: NDArray[np.float32], width: int, at: Places, values: NDArray[Any]) -> NDArray[np.float32]:
    grown = np.zeros((len(old), width), dtype=np.float32)
    grown[:, : old.shape[1]] = old
    grown[:, at] = values
    return grown


def _block(columns: DesignColumns, part: Part) -> NDArray[np.float32]:
    """[rows, p + 1] columns and residual of a block, not white."""
    residual = columns.residual[part.segment][part.rows, None]
    return np.concatenate([columns.values[part.segment][part.rows], residual.astype(np.float32)], axis=1)


def _whitened(whitener: Whitener, part: Part, values: NDArray[Any]) -> NDArray[np.float32]:
    """White rows of a block from its rows and its past."""
    return whitener.apply(values) if part.past else whitener.from_start(values)
