"""Small differences between the recordings in question and the reference that are no effects: free columns."""

from __future__ import annotations

import numpy as np

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Column, Regression
from acqd.discrepancy.regression.setup import Setup
from acqd.discrepancy.selection.ranking import rank_pooled
from acqd.discrepancy.selection.relevance import shows_drift
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library

_LEVEL = "a level"
"""Owner of the free level's column."""


def with_small_differences(setup: Setup) -> Regression:
    """The regression that effects compete in, with a free clock and a free level where these are small."""
    return setup.regression.with_columns(setup.design.blocks, [*_small_clock(setup), *_small_level(setup)])


def _small_clock(setup: Setup) -> list[Column]:
    """A constant clock offset: two alignments differ by a millisecond or two."""
    effects = library()
    clocks = [
        c for c in setup.design.columns.candidates
        if c.id and effects[c.id].acts_on == "clock" and not effects[c.id].follows_clock
    ]  # fmt: skip
    return _free(setup, clocks[:1], THRESHOLDS.clock_smallest_s, "")


def _small_level(setup: Setup) -> list[Column]:
    """A constant load, beside a reference of minutes.

    Standby power drifts by more within an hour than within such a reference. Without the column, a loss that is nearly
    constant would explain the drift, since a constant load of that size is no effect.
    """
    design = setup.design
    if shows_drift(design):
        return []
    standby = np.array([design.columns.model.layout.place("standby").start])
    level = Candidate("", _LEVEL, standby, key=_LEVEL)
    return _free(setup, [level], _largest_level(design), _LEVEL)


def level_difference(regression: Regression) -> float | None:
    """W by which the free level differs from the reference, given all other columns; None without such a level."""
    places = [number for number, column in enumerate(regression.columns) if column.owner == _LEVEL]
    return float(regression.solve()[places[0]]) if places else None


def without_large_level(base: Regression, regression: Regression, design: Design) -> Regression:
    """`base` without its free level where that has become large beside the effects in `regression`.

    A constant load and an effect of the other sign may hide each other until one of them is selected.
    """
    level_W = level_difference(regression)
    small = level_W is None or abs(level_W) <= _largest_level(design)
    return base if small else base.without(_LEVEL)


def _largest_level(design: Design) -> float:
    """W."""
    return THRESHOLDS.level_share_of_range * design.columns.dynamic_range


def _free(setup: Setup, candidates: list[Candidate], largest: float, owner: str) -> list[Column]:
    """A column for a candidate of one coefficient that is at most `largest`."""
    gate = setup.gates[0].open
    found = rank_pooled(setup.design, setup.regression, gate, candidates) if candidates else []
    if not found or abs(float(found[0].coefficients[0])) > largest:
        return []
    return [Column(int(found[0].candidate.places[0]), gate, owner=owner)]
