"""From recordings and a grey box to a design with its noise, the model that competes, and possible onsets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design, distrust, make_design, whiten
from acqd.discrepancy.regression.gram import Column, Model
from acqd.discrepancy.regression.grey_box_columns import deviations
from acqd.discrepancy.residual.whitening import ORDER, Whitener
from acqd.discrepancy.selection.stepwise import Gate, onset_gates
from acqd.models.effects import library
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import prior
from acqd.models.segments import Segment
from acqd.numerics import mad_sigma, solve_scaled_ridge
from acqd.robot.arm import Arm
from acqd.robot.description import RobotDescription
from acqd.robot.dynamics import inertial_parameters

_FEWEST_FOR_NOISE = 4  # reference recordings
_RIDGE = 1e-6
_ACTS = 0.01  # of the power that a column has in the recordings in question
_HELD = 1e-9
_LAG_SPREAD_S = 0.003


def prepare(
    model: GreyBox,
    robot: RobotDescription,
    in_question: list[Segment],
    reference: list[Segment],
    chosen: set[str],
    withheld: set[str],
    progress: Callable[[float], None],
) -> tuple[Design, Model, list[Gate]]:
    """With `reference`, what is common to both is free in the model; what only `fresh` has is the question.

    Without, the question is what the model lacks in all of them. `withheld` groups of the model's parameters are
    held at nought.
    """
    arm = Arm(robot)
    segments = [(each, False) for each in reference] + [(each, True) for each in in_question]
    design = make_design(model, arm, segments, chosen, frozenset(withheld), progress)
    _withhold(design, withheld)
    belief = prior(model.layout, robot, inertial_parameters(arm), 0.0, model.step_s)
    spread = deviations(model, belief.deviation)
    spread[model.layout.place("lag")] = _LAG_SPREAD_S  # else it and the clocks play against each other
    for group in withheld:
        spread[model.layout.place(group)] = _HELD
    everywhere = np.ones(len(design.parts))
    base = [Column(k, everywhere, float(spread[k])) for k in range(design.base)]
    whiten(design, Whitener.of(design.residual))
    enough = len({each.recording for each in reference}) >= _FEWEST_FOR_NOISE
    noise_weights = 1 - design.in_question if enough else everywhere
    left = _left_by_everything(design, base, noise_weights)
    whiten(design, Whitener.of(left))
    design.patient = Whitener.of(left, 3 * ORDER)
    _distrust_outliers(design, base, bool(reference))
    common = _common(design) if reference else []
    columns = [*base, *(Column(k, everywhere) for k in common), *block_intercepts(design, noise_weights)]
    return design, Model(design.blocks, columns), onset_gates(design, design.in_question)


def _withhold(design: Design, withheld: set[str]) -> None:
    """Take what the model was denied out of the prediction, so that it is there to be found."""
    layout = design.model.layout
    for group in withheld:
        place = layout.place(group)
        for number, raw in enumerate(design.raw):
            design.residual[number] = design.residual[number] + raw[:, place] @ design.model.values[place]


def block_intercepts(design: Design, noise_weights: Floats) -> list[Column]:
    """A level of its own for every block, as far as levels are known to wander.

    Standby power wanders over tens of seconds, longer than the noise model remembers; without this, a block's mean
    would count as some thousand independent witnesses of a constant load.
    """
    means = np.array(
        [design.residual[p.segment][p.rows].mean() for p, w in zip(design.parts, noise_weights, strict=True) if w]
    )
    deviation = max(mad_sigma(means), 1e-3)
    standby = design.model.layout.place("standby").start
    return [
        Column(standby, np.eye(len(design.parts))[k], deviation, block_intercept=True) for k in range(len(design.parts))
    ]


def _common(design: Design) -> list[int]:
    """Columns of effects that a model may lack from the start: in a contrast they are free for both sides.

    What never acts in the reference (a tool that was not there) is only a question of the new recordings.
    """
    effects = library()
    found: set[int] = set()
    for candidate in design.candidates:
        if candidate.id and effects[candidate.id].structural:
            found |= set(candidate.places.tolist())
    power = np.einsum("bkk->bk", design.blocks.plain) / np.maximum(design.blocks.rows, 1.0)[:, None]
    in_question, before = (power[side > 0].mean(axis=0) for side in (design.in_question, 1 - design.in_question))
    return sorted(k for k in found if before[k] > _ACTS * in_question[k])


def _left_by_everything(design: Design, base: list[Column], weights: Floats) -> list[Floats]:
    """Residuals of a fit of all columns there are: only noise is left for certain (notes/residual.md, stage 3)."""
    beta = _everything(design, base, weights)
    open_ = sorted({part.segment for part, weight in zip(design.parts, weights, strict=True) if weight})
    return [design.residual[k] - design.raw[k] @ beta for k in open_]


def _distrust_outliers(design: Design, base: list[Column], contrast: bool) -> None:
    """Each side by a fit of everything to itself: an effect that only one of them has is no outlier."""
    sides = [design.in_question, 1 - design.in_question] if contrast else [design.in_question]
    fits: list[Floats] = [np.zeros(design.blocks.y)] * len(design.parts)
    for side in sides:
        beta = _everything(design, base, side)
        fits = [beta if own else other for own, other in zip(side, fits, strict=True)]
    distrust(design, fits)


def _everything(design: Design, base: list[Column], weights: Floats) -> Floats:
    """[p] coefficients of all columns there are, on weighted blocks."""
    everything = [*base, *(Column(k, np.ones(len(design.parts))) for k in range(design.base, design.blocks.y))]
    A, b, _ = Model(design.blocks, everything).normal(weights)
    return solve_scaled_ridge(A, b, _RIDGE)
