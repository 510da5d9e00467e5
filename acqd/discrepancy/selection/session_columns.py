"""Columns that every session may have: a level and a clock that differ a little from those of the reference.

They are random effects with a prior, not free and not absent, so that an effect is judged beside them: a constant load
of the size that standby power drifts by, or a shift of the size of two alignments' errors, explains nothing more.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Column, Regression
from acqd.discrepancy.regression.setup import Setup
from acqd.discrepancy.selection.ranking import Finding, Rows
from acqd.discrepancy.selection.spread import clock_deviation_s, learning_rate, sessions_of, variance_of_sessions
from acqd.models.effects import library

LEVEL = "level of the session"
"""Owner of the level's column."""
CLOCK = "clock of the session"
"""Owner of the clock's column."""


def with_sessions(setup: Setup) -> Rows:
    """What a search starts from: rows with a learning rate, and the columns of sessions."""
    columns = session_columns(setup.design, setup.regression)
    rate = learning_rate(setup.design, setup.regression)
    return Rows(setup.design, setup.regression.with_columns(setup.design.blocks, columns), rate)


def session_columns(design: Design, regression: Regression) -> list[Column]:
    """Columns of every session in question; none without a reference to differ from."""
    if not sessions_of(design.parts, in_question=False):
        return []
    level = Candidate("", LEVEL, np.array([design.columns.model.layout.part("standby").start]), key=LEVEL)
    finding = Finding(level, np.ones(1), np.zeros(1), 0.0)
    effects = library()
    clocks = [
        candidate for candidate in design.columns.candidates
        if candidate.id and effects[candidate.id].acts_on == "clock" and not effects[candidate.id].follows_clock
    ]  # fmt: skip
    columns = []
    for gate in _sessions_in_question(design):
        variance, _ = variance_of_sessions(design, regression, finding, gate)
        columns.append(Column(int(level.indices[0]), gate, float(np.sqrt(variance)), owner=LEVEL))
        columns += [Column(int(each.indices[0]), gate, clock_deviation_s(design), owner=CLOCK) for each in clocks]
    return columns


def _sessions_in_question(design: Design) -> list[Floats]:
    """[blocks] gate of every session in question."""
    names = [design.columns.segments[part.segment].session if part.in_question else None for part in design.parts]
    return [np.array([own == name for own in names]) * 1.0 for name in dict.fromkeys(names) if name is not None]
