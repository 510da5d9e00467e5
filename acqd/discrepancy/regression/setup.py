"""From recordings and a grey box to a design with a noise model, the regression that competes, and possible onsets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import Witness
from acqd.discrepancy.regression.design_columns import DesignColumns, design_columns
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Column, Regression
from acqd.discrepancy.regression.onset import Gate, onset_gates
from acqd.discrepancy.regression.torque_alternatives import torque_groups
from acqd.discrepancy.residual.known_rows import known_rows
from acqd.discrepancy.residual.whitening import Whitener
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import prior
from acqd.models.segments import Segment
from acqd.numerics import mad_sigma, solve_scaled_ridge
from acqd.robot.arm import Arm
from acqd.robot.description import RobotDescription
from acqd.robot.dynamics import inertial_parameters

_RIDGE = 1e-6
_ENDLESS = 1e3
"""Prior deviation of a parameter without prior, relative to its value: wide enough to be free."""


@dataclass(frozen=True, slots=True)
class Question:
    """Recordings and models that a regression is set up for."""

    model: GreyBox
    robot: RobotDescription
    in_question: list[Segment]
    reference: list[Segment]
    """Recordings to compare with; without any, the question is what the model lacks in all recordings."""
    chosen: frozenset[str]
    """Ids of effects that compete."""
    withheld: frozenset[str]
    """Groups of the model's parameters that are held at zero."""


@dataclass(frozen=True, slots=True)
class Setup:
    """Everything that the selection starts from."""

    design: Design
    regression: Regression
    gates: list[Gate]
    """The first gate is the question, the others are possible onsets."""


def set_up(question: Question, progress: Callable[[float], None]) -> Setup:
    """With a reference, structural effects are free on both sides, and only a difference can be selected."""
    arm = Arm(question.robot)
    segments = [(each, False) for each in question.reference] + [(each, True) for each in question.in_question]
    columns = design_columns(question.model, arm, segments, question.chosen, question.withheld, progress)
    columns = columns.with_withheld(question.withheld)
    base = _base(columns, arm, question)
    everywhere = np.ones(len(columns.parts))
    design = Design.of(columns, Whitener.of(list(columns.residual)))
    enough = len({each.recording for each in question.reference}) >= THRESHOLDS.fewest_for_noise
    noise_weights = 1 - columns.in_question if enough else everywhere
    left = _left_by_everything(design, base, noise_weights)
    del design  # hours of white rows: not two designs at once
    design = Design.of(columns, Whitener.of(left), Whitener.of(left, 3 * THRESHOLDS.noise_order))
    design = _without_outliers(design, base, bool(question.reference))
    design = replace(design, witness=Witness.of(question.model, arm, segments, columns.scenes))
    common = _common(design) if question.reference else []
    free = [*base, *(Column(k, everywhere) for k in common), *block_intercepts(columns, noise_weights)]
    return Setup(design, Regression(design.blocks, free), onset_gates(list(columns.parts)))


def _base(columns: DesignColumns, arm: Arm, question: Question) -> list[Column]:
    """Columns of the base model, with the description as prior of how far its parameters may be wrong.

    Friction and losses are fitted already, so that they change by a share of their values. A wider prior would let
    the square of an absurd friction stand in for the mechanical power.
    """
    layout = question.model.layout
    belief = prior(layout, question.robot, inertial_parameters(arm), 0.0, question.model.step_s)
    endless = _ENDLESS * np.maximum(np.abs(question.model.values), 1.0)
    deviation = np.where(np.isfinite(belief.deviation), belief.deviation, endless)
    effort = question.robot.effort
    for group, least in (("coulomb", effort), ("viscous", effort), ("copper", 0.0), ("conduction", 1 / effort)):
        place = layout.place(group)
        change = THRESHOLDS.base_change * np.abs(question.model.values[place]) + THRESHOLDS.base_least_change * least
        deviation[place] = np.minimum(deviation[place], np.maximum(change, THRESHOLDS.withheld_deviation))
    deviation[layout.place("lag")] = THRESHOLDS.lag_deviation_s
    for group in question.withheld:
        deviation[layout.place(group)] = THRESHOLDS.withheld_deviation
    everywhere = np.ones(len(columns.parts))
    return [Column(k, everywhere, float(deviation[k])) for k in range(columns.base)]


def block_intercepts(columns: DesignColumns, noise_weights: Floats) -> list[Column]:
    """A random intercept per block; its deviation is the spread of the block means where `noise_weights` is not 0.

    Standby power drifts over tens of seconds, longer than the noise model remembers. Without random intercepts, the
    rows of a block would count as some thousand independent observations of a constant load.
    """
    pairs = zip(columns.parts, noise_weights, strict=True)
    means = np.array([columns.residual[part.segment][part.rows].mean() for part, weight in pairs if weight])
    deviation = max(mad_sigma(means), THRESHOLDS.intercept_least_W)
    standby = columns.model.layout.place("standby").start
    gates = np.eye(len(columns.parts))
    return [Column(standby, gate, deviation, block_intercept=True) for gate in gates]


def _common(design: Design) -> list[int]:
    """Columns of structural effects: a model may lack them from the start, so that both sides are free to have them.

    A column that never acts in the reference (a tool that was not mounted) remains a question about the new recordings.
    """
    effects = library()
    structural: set[int] = set()
    for candidate in design.columns.candidates:
        if candidate.id and effects[candidate.id].structural:
            structural |= set(candidate.places.tolist())
    power = design.blocks.plain.diagonal() / np.maximum(design.blocks.rows, 1.0)[:, None]
    question = design.columns.in_question
    now, before = (power[side > 0].mean(axis=0) for side in (question, 1 - question))
    return sorted(k for k in structural if before[k] > THRESHOLDS.common_share * now[k])


def _left_by_everything(design: Design, base: list[Column], weights: Floats) -> list[Floats]:
    """Residuals of a fit of all columns: the only part that is noise for certain."""
    beta = _fit_of_everything(design, base, weights)
    open_ = sorted({part.segment for part, weight in zip(design.parts, weights, strict=True) if weight})
    columns = design.columns
    known = {k: known_rows(columns.segments[k]) for k in open_}
    return [columns.residual[k][known[k]] - columns.values[k][known[k]] @ beta for k in open_]


def _without_outliers(design: Design, base: list[Column], contrast: bool) -> Design:
    """Both sides by a fit of everything to themselves: an effect that only one side has makes no outliers."""
    question = design.columns.in_question
    sides = [question, 1 - question] if contrast else [question]
    fits: list[Floats] = [np.zeros(design.blocks.white.y)] * len(design.parts)
    for side in sides:
        beta = _fit_of_everything(design, base, side)
        fits = [beta if own else other for own, other in zip(side, fits, strict=True)]
    return design.without_outliers(fits)


def _fit_of_everything(design: Design, base: list[Column], weights: Floats) -> Floats:
    """[p] coefficients of all columns of the design but the unnamed torque laws (0), on weighted blocks."""
    gram = design.blocks.white
    # torque laws are many and similar to effects: in few recordings they would explain the noise too
    last = gram.y - sum(count for _, count in torque_groups(design.columns.model.axes))
    everything = np.arange(last)
    A, b = np.zeros((last, last)), np.zeros(last)
    for block in np.flatnonzero(weights).tolist():
        A += weights[block] * gram.take(block, everything, everything)
        b += weights[block] * gram.residual_products(block, everything)
    A[np.diag_indices(len(base))] += np.array([column.deviation for column in base]) ** -2.0
    beta = np.zeros(gram.y)
    beta[:last] = solve_scaled_ridge(A, b, _RIDGE)
    return beta
