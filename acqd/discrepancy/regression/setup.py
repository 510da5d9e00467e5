"""From recordings and a grey box to a design with a noise model, the regression that competes, and possible onsets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import Witness
from acqd.discrepancy.regression.common_load import without_common_load
from acqd.discrepancy.regression.design_columns import DesignColumns, Part, design_columns
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.everything import inliers, left_by_everything, with_noise
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.least_squares import Column, Regression
from acqd.discrepancy.regression.onset import Gate, onset_gates
from acqd.discrepancy.regression.white_rows import white_products
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.memory import release_freed
from acqd.models.effects import library
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import prior
from acqd.models.segments import Segment
from acqd.numerics import mad_sigma
from acqd.residual.thresholds import NOISE
from acqd.residual.whitening import Whitener
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inertial_parameters

LEAST_LEVEL_W = 1e-3
"""Standard deviation of the level of a minute, at least."""
COMMON_LOAD = "common load"
"""Owner of the column of a load that switches on both sides."""
_HELD = 1e-9
"""Prior deviation that holds a withheld parameter at zero."""
_ENDLESS = 1e3
"""Prior deviation of a parameter without prior, relative to its value: wide enough to be free."""


@dataclass(frozen=True, slots=True)
class Comparison:
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
    begins: Mapping[str, float] = field(default_factory=dict)
    """UTC of the start of the sessions in question by name, held-out recordings included."""


@dataclass(frozen=True, slots=True)
class Setup:
    """Everything that the selection starts from."""

    design: Design
    regression: Regression
    gates: list[Gate]
    """The first gate is the question, the others are possible onsets."""


def set_up(comparison: Comparison, progress: Callable[[float], None]) -> Setup:
    """With a reference, structural effects are free on both sides, and only a difference can be selected."""
    segments = [(each, False) for each in comparison.reference] + [(each, True) for each in comparison.in_question]
    columns = design_columns(
        comparison.model, segments, comparison.chosen, comparison.withheld, progress, comparison.begins
    )
    release_freed()  # what scenes leave behind is larger than what follows
    columns = columns.with_withheld(comparison.withheld)
    base = _base(columns, comparison)
    everywhere = np.ones(len(columns.parts))
    enough = len({each.recording for each in comparison.reference}) >= THRESHOLDS.fewest_recordings
    noise_weights = 1 - columns.in_question if enough else everywhere
    columns, load = without_common_load(columns, base) if enough else (columns, None)
    left = list(left_by_everything(columns, Whitener.of(list(columns.residual)), base, noise_weights).values())
    whitener = Whitener.of(left)
    slow = Whitener.of(left, 3 * NOISE.noise_order)
    columns = with_noise(columns, whitener, base)
    products = [white_products(columns, whitener, part) for part in columns.parts]
    design = Design.of(columns, whitener, slow, inliers(columns, whitener, base, products), products)
    design = replace(design, witness=Witness.of(comparison.model, comparison.robot, segments, columns.scenes))
    common = _common(design) if comparison.reference else []
    free = [*base, *(Column(k, everywhere) for k in common), *block_intercepts(columns, noise_weights)]
    if load is not None:
        design, indices = design.with_columns(load)
        free.append(Column(int(indices[0]), everywhere, owner=COMMON_LOAD))
    return Setup(design, Regression(design.blocks, free), onset_gates(list(columns.parts)))


def _base(columns: DesignColumns, comparison: Comparison) -> list[Column]:
    """Columns of the base model, with the description as prior of how far its parameters may be wrong.

    Friction and losses are fitted already, so that they change by a share of their values. A wider prior would let
    the square of an absurd friction stand in for the mechanical power.
    """
    layout = comparison.model.layout
    belief = prior(layout, comparison.robot, inertial_parameters(comparison.robot), 0.0, comparison.model.step_s)
    endless = _ENDLESS * np.maximum(np.abs(comparison.model.values), 1.0)
    deviation = np.where(np.isfinite(belief.deviation), belief.deviation, endless)
    effort = comparison.robot.effort
    for group, least in (("coulomb", effort), ("viscous", effort), ("copper", 0.0), ("conduction", 1 / effort)):
        place = layout.part(group)
        change = THRESHOLDS.base_change * np.abs(comparison.model.values[place]) + THRESHOLDS.base_least_change * least
        deviation[place] = np.minimum(deviation[place], np.maximum(change, _HELD))
    deviation[layout.part("lag")] = THRESHOLDS.lag_deviation_s
    for group in comparison.withheld:
        deviation[layout.part(group)] = _HELD
    everywhere = np.ones(len(columns.parts))
    return [Column(k, everywhere, float(deviation[k])) for k in range(columns.base)]


def block_intercepts(columns: DesignColumns, noise_weights: Floats) -> list[Column]:
    """A random intercept per block; its deviation is the spread of the block means where `noise_weights` is not 0.

    Standby power drifts over tens of seconds, longer than the noise model remembers. Without random intercepts, the
    rows of a block would count as some thousand independent observations of a constant load.
    """
    pairs = zip(columns.parts, noise_weights, strict=True)
    means = np.array([columns.residual[part.segment][part.rows].mean() for part, weight in pairs if weight])
    deviation = max(mad_sigma(means), LEAST_LEVEL_W)
    standby = columns.model.layout.part("standby").start
    gates = np.eye(len(columns.parts))
    return [Column(standby, gate, deviation, block_intercept=True) for gate in gates]


def _common(design: Design) -> list[int]:
    """Columns of structural effects: a model may lack them from the start, so that both sides are free to have them.

    A column that hardly acts in the reference (a tool that was not mounted, cold gears after an hour of work) remains a
    question about the new recordings: free on both sides, it would take up what the reference cannot contradict. The
    session in which a column acts most decides: a warm session beside a cold one leaves cold gears a question.
    """
    effects = library()
    structural: set[int] = set()
    for candidate in design.columns.candidates:
        if candidate.id and effects[candidate.id].structural:
            structural |= set(candidate.indices.tolist())
    indices = np.array(sorted(structural), dtype=int)
    now, before = (_most_in_a_session(design, indices, in_question=side) for side in (True, False))
    return list(indices[before > THRESHOLDS.common_share * now])


def _most_in_a_session(design: Design, indices: Indices, *, in_question: bool) -> Floats:
    """[indices] W^2, mean of the blocks of the session in which a column acts most."""
    sessions: dict[str, list[Part]] = {}
    for part in design.parts:
        if part.in_question == in_question:
            sessions.setdefault(design.columns.segments[part.segment].session, []).append(part)
    return np.asarray(np.max([_mean_squares(design, parts, indices) for parts in sessions.values()], axis=0))


def _mean_squares(design: Design, parts: list[Part], indices: Indices) -> Floats:
    """[indices] W^2, mean of the blocks."""
    squares = [(design.values(part.segment, indices, part.own) ** 2).mean(axis=0) for part in parts]
    return np.asarray(np.mean(squares, axis=0))
