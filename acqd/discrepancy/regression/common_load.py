"""Columns without the power of a load that switches on both sides (ADR 51).

The states of the load follow from what a fit of everything leaves, on each side apart: an effect that only one side has
switches nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.loads.common import CommonLoad
from acqd.discrepancy.regression.design_columns import DesignColumns
from acqd.discrepancy.regression.everything import left_by_everything
from acqd.discrepancy.regression.least_squares import Column
from acqd.residual.known_rows import known_rows
from acqd.residual.whitening import Whitener

_ROUNDS = 2
"""Searches: the fit explains a part of the load until the load is taken out."""


def without_common_load(columns: DesignColumns, base: list[Column]) -> tuple[DesignColumns, list[Floats] | None]:
    """Columns whose residuals lack the load, and the load's power [T, 1] W per segment; None without such a load."""
    power: list[Floats] = [np.zeros(len(residual)) for residual in columns.residual]
    load = None
    for _ in range(_ROUNDS):
        left = _left(_less(columns, power), base)
        reference = [k for k, side in enumerate(columns.scenes.in_question) if not side and k in left]
        whitener = Whitener.of([left[k] for k in reference])
        loaded = {k: rows + power[k][known_rows(columns.segments[k])] for k, rows in left.items()}
        load = CommonLoad.of([loaded[k] for k in reference], whitener)
        if load is None:
            return columns, None
        for k, own in zip(loaded, load.power(list(loaded.values())), strict=True):
            known = known_rows(columns.segments[k])
            power[k] = np.pad(own, (known.start, len(power[k]) - known.stop), mode="edge")
    return replace(_less(columns, power), load=load), [own[:, None] for own in power]


def _left(columns: DesignColumns, base: list[Column]) -> dict[int, Floats]:
    """[T] W of known rows by segment, in the noise of the reference: an effect in question is no noise."""
    pairs = zip(columns.residual, columns.scenes.in_question, strict=True)
    whitener = Whitener.of([residual for residual, asked in pairs if not asked])
    first, second = (
        left_by_everything(columns, whitener, base, side) for side in (columns.in_question, 1 - columns.in_question)
    )
    return first | second


def _less(columns: DesignColumns, power: list[Floats]) -> DesignColumns:
    pairs = zip(columns.residual, power, strict=True)
    return replace(columns, residual=tuple(residual - own for residual, own in pairs))
