"""A fit of all columns at once: only what remains is noise for certain, and only its outliers belong to no effect."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import DesignColumns, Part
from acqd.discrepancy.regression.gram import symmetric
from acqd.discrepancy.regression.least_squares import Column
from acqd.discrepancy.regression.row_noise import new_power, rising_of, usual_noise
from acqd.discrepancy.regression.torque_alternatives import torque_groups
from acqd.discrepancy.regression.white_rows import block_rows, white_rows
from acqd.numerics import mad_sigma, solve_scaled_ridge
from acqd.residual.known_rows import known_rows
from acqd.residual.thresholds import NOISE
from acqd.residual.whitening import Whitener

_RIDGE = 1e-6


def left_by_everything(
    columns: DesignColumns, whitener: Whitener, base: list[Column], weights: Floats
) -> dict[int, Floats]:
    """[T] W of known rows by segment with weighted blocks: residuals of a fit of all columns to those blocks."""
    parts = [part for part, weight in zip(columns.parts, weights, strict=True) if weight]
    beta = _fit(columns, base, _sum_of_products(columns, whitener, parts))
    open_ = sorted({part.segment for part in parts})
    known = {k: known_rows(columns.segments[k]) for k in open_}
    return {k: columns.residual[k][known[k]] - columns.values[k][known[k]] @ beta for k in open_}


def inliers(
    columns: DesignColumns, whitener: Whitener, base: list[Column], products: Sequence[Floats]
) -> tuple[NDArray[np.bool_], ...]:
    """[rows] per block: False for outliers even of a fit of everything. `products`: of every block.

    A protective stop or a collision says nothing about an effect, and a few such rows outweigh hours. Both sides are
    fitted apart: an effect that only one side has makes no outliers.
    """
    p = columns.values[0].shape[1]
    fitted = [*range(_fitted(columns)), p]

    def of_fitted(blocks: list[int]) -> Floats:
        triangle = np.zeros_like(products[0])
        for number in blocks:
            triangle += products[number]
        return symmetric(triangle, p + 1)[np.ix_(fitted, fitted)]

    left = _white_left(columns, whitener, base, of_fitted)
    spread = mad_sigma(np.concatenate(left), 0.0) + 1e-9
    return tuple(np.abs(rows) < NOISE.outlier * spread for rows in left)


def with_noise(columns: DesignColumns, whitener: Whitener, base: list[Column]) -> DesignColumns:
    """With the noise of each row: fast motion may have ten times the noise of slow motion.

    One noise for all would let a few loud rows decide, and the quiet ones would say nothing. The noise rises with the
    power (`row_noise`), and differs between recordings. That of a recording is relative to the median of the side's
    recordings: what an unknown cause adds to all of a side is no noise.
    """
    left = _white_left(
        columns, whitener, base,
        lambda blocks: _sum_of_products(columns, whitener, [columns.parts[number] for number in blocks]),
    )  # fmt: skip
    power = [new_power(columns, whitener, part) for part in columns.parts]
    rising = rising_of(np.concatenate(left), np.concatenate(power))
    usual = [usual_noise(rising, each) for each in power]
    rows: dict[tuple[bool, str], list[Floats]] = {}
    for part, white, deviation in zip(columns.parts, left, usual, strict=True):
        rows.setdefault((part.in_question, part.recording), []).append(white / deviation)
    spread = {key: mad_sigma(np.concatenate(each), 0.0) + 1e-9 for key, each in rows.items()}
    medians = {side: float(np.median([s for key, s in spread.items() if key[0] == side])) for side, _ in spread}
    parts = tuple(
        replace(part, noise=deviation * spread[part.in_question, part.recording] / medians[part.in_question])
        for part, deviation in zip(columns.parts, usual, strict=True)
    )
    return replace(columns, parts=parts, rising=rising)


def _white_left(
    columns: DesignColumns, whitener: Whitener, base: list[Column], products: Callable[[list[int]], Floats]
) -> list[Floats]:
    """[rows] per block, white: what a fit of everything leaves, of both sides apart.

    `products`: of the numbers of some blocks, as `_sum_of_products`.
    """
    question = columns.in_question
    left: list[Floats] = [np.empty(0)] * len(columns.parts)
    for side in (question, 1 - question):
        blocks = np.flatnonzero(side).tolist()
        if not blocks:
            continue
        beta = _fit(columns, base, products(blocks))
        for number in blocks:
            part = columns.parts[number]
            measured = columns.residual[part.segment][part.rows]
            left[number] = white_rows(whitener, part, measured - columns.values[part.segment][part.rows] @ beta)
    return left


def _fitted(columns: DesignColumns) -> int:
    """Number of columns that everything is: all but the last, those of the unnamed torque laws.

    Torque laws are many and similar to effects: in few recordings they would explain the noise, too.
    """
    laws = sum(len(group.columns) for group in torque_groups(columns.model.axes))
    return int(columns.values[0].shape[1]) - laws


def _sum_of_products(columns: DesignColumns, whitener: Whitener, parts: Iterable[Part]) -> Floats:
    """[fitted + 1, fitted + 1] products of the white rows of blocks: of the fitted columns, and of the residual."""
    fitted = _fitted(columns)
    total = np.zeros((fitted + 1, fitted + 1))
    for part in parts:
        white = white_rows(whitener, part, block_rows(columns, part, fitted))
        total += white.T @ white
    return total


def _fit(columns: DesignColumns, base: list[Column], products: Floats) -> Floats:
    """[p] coefficients of the fitted columns (0 of the others) by their products and those with the residual."""
    A, b = products[:-1, :-1].copy(), products[:-1, -1]
    A[np.diag_indices(len(base))] += np.array([column.deviation for column in base]) ** -2.0
    beta = np.zeros(columns.values[0].shape[1])
    beta[: len(b)] = solve_scaled_ridge(A, b, _RIDGE)
    return beta
