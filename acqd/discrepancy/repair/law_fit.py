"""Coefficients, size and strength of a law without a name, beside the base model and the kept effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acqd import student
from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Regression
from acqd.discrepancy.regression.torque_alternatives import LawColumns
from acqd.discrepancy.repair.correction import SIZE
from acqd.discrepancy.repair.torque_scale import TorqueScale
from acqd.discrepancy.selection.accepted import Selection, Unknown
from acqd.discrepancy.selection.ranking import Finding, Rows, ranked
from acqd.discrepancy.selection.shape_fit import at_secant_slope, columns_of
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.augmented import Term
from acqd.models.effects.laws.law import Quantity
from acqd.models.effects.places import Parameter, Place
from acqd.models.effects.scene import Scene
from acqd.models.greybox.parameters import SLIDING_UNITS

_QUANTILE = 0.95
"""Share of the rows with the law that stay below its size: single rows of a sudden stop say little."""
_FIXED = 1e-6
"""Relative standard deviation of a coefficient that does not change."""


@dataclass(frozen=True, slots=True)
class LawFit:
    """A fitted law over the recordings in question."""

    part: LawColumns
    unit: str
    """Nm, N or W."""
    shape: dict[str, float]
    coefficients: Floats
    """[k], in the scale of the model's torques."""
    recordings: int
    """In which the law acts."""
    left_out: list[Floats]
    """[k] each: without one of the recordings."""
    along: Quantity
    columns: Floats
    """[N, joints, k] Nm or W per unit coefficient, at substeps."""

    def strength(self, scale: TorqueScale) -> Floats:
        """[N] Nm, N or W of the law in true units; of the joint with the largest torque, for a law of all joints."""
        return self._strength(self.coefficients) * scale.corrected(1.0, 0.0, self.unit)[0]

    def term(self, scale: TorqueScale) -> Term:
        """With its size and the interval of that (delete-one-recording jackknife and the error of the columns)."""
        where = f"joint {self.part.joint}" if self.part.joint else "robot"
        size, sizes = self._size(self.coefficients), np.array([self._size(each) for each in self.left_out])
        known = len(sizes) >= THRESHOLDS.few_recordings
        spread = float(student.ppf(0.975, len(sizes) - 1) * np.sqrt((len(sizes) - 1) * sizes.var())) if known else 0.0
        of_columns = THRESHOLDS.interval_width * THRESHOLDS.column_deviation * size
        value, half = scale.corrected(size, float(np.hypot(spread, of_columns)), self.unit)
        interval = [max(value - half, 0.0), value + half] if known else None
        parameters = {SIZE: {"value": value, "unit": self.unit, "ci95": interval}}
        return Term(self.part.law.id, where, self.shape, self.part.columns, self.coefficients, parameters)

    def _size(self, coefficients: Floats) -> float:
        """Strength that 95 % of the rows stay below in which the law acts, in the model's units.

        A friction that begins at a high speed acts in few rows.
        """
        strength = np.abs(self._strength(coefficients))
        return float(np.quantile(strength[strength >= THRESHOLDS.acting_share * strength.max()], _QUANTILE))

    def _strength(self, coefficients: Floats) -> Floats:
        by_joint = self.columns @ coefficients
        return np.asarray(by_joint[:, np.abs(by_joint).max(axis=0).argmax()])


def fit_law(selection: Selection, unknown: Unknown, kept: set[tuple[str, str]]) -> LawFit | None:
    """The law of an unknown structure at the secant slope of its torque; None where it does not act.

    Effects that are `kept` (id, place) have the coefficients that they are reported with; the others are left out.
    """
    candidate, gate = unknown.finding.candidate, unknown.gate
    part = candidate.law_columns
    assert part is not None
    design = replace(selection.design, witness=None)
    rows = Rows(design, _beside(selection, kept), selection.rows.learning_rate)
    shape = part.law.shape_of(design.columns.motion, part.joint)
    unit = _unit(design, part)
    place = Place("", part.columns, tuple(Parameter(f"c{k + 1}", unit) for k in range(len(part.columns))))
    columns = columns_of(design, part.law, place, gate.open)
    design, indices = design.with_columns(columns.kept(shape))
    own = replace(candidate, indices=indices)
    rows, found = at_secant_slope(rows.on(design), gate.open, own, columns, shape)
    design = rows.design
    if found is None:
        return None
    open_ = [each for each, acts in zip(design.parts, gate.open, strict=True) if acts]
    names = sorted({each.recording for each in open_})
    left_out = [finding.coefficients for name in names for finding in _without_recording(rows, gate.open, found, name)]
    begins = {} if gate.start is None else {"begin_s": min(each.start_s for each in open_)}
    seen = _over_question(design, part, shape)
    return LawFit(part, unit, shape | begins, found.coefficients, len(names), left_out, *seen)


def _beside(selection: Selection, kept: set[tuple[str, str]]) -> Regression:
    """The base model, and the kept effects with coefficients that do not change."""
    fixed = {each.key for each in selection.effects if (each.id, each.place.where) in kept}
    others = {each.key for each in selection.effects} - fixed
    columns = []
    for column, value in zip(selection.regression.columns, selection.regression.solve().tolist(), strict=True):
        if column.owner in fixed:
            columns.append(replace(column, mean=value, deviation=_FIXED * max(abs(value), _FIXED)))
        elif not {column.owner, column.varies} & others:
            columns.append(column)
    return Regression(selection.design.blocks, columns)


def _without_recording(rows: Rows, gate: Floats, found: Finding, name: str) -> list[Finding]:
    weights = np.array([float(not block.in_question or block.recording != name) for block in rows.design.parts])
    return ranked(rows, gate, [found.candidate], weights)


def _unit(design: Design, part: LawColumns) -> str:
    unit = part.law.sized_in
    return SLIDING_UNITS.get(unit, unit) if part.joint - 1 in design.columns.model.layout.sliding else unit


def _over_question(design: Design, part: LawColumns, shape: dict[str, float]) -> tuple[Quantity, Floats]:
    """What the law depends on, and its columns [N, joints, k], over all recordings in question."""
    quantities, columns = [], []
    scenes = design.columns.scenes
    for number, in_question in enumerate(scenes.in_question):
        if in_question:
            scene = scenes[number]
            quantities.append(part.law.along(scene, shape))
            columns.append(_strength_columns(scene, part, shape))
    values = np.concatenate([each.values for each in quantities])
    return replace(quantities[0], values=values), np.concatenate(columns)


def _strength_columns(scene: Scene, part: LawColumns, shape: dict[str, float]) -> Floats:
    """[N, joints, k] Nm of torque at the law's joint (of the whole robot: at every joint), or W."""
    chosen = list(part.columns)
    if part.law.acts_on != "torque":
        return part.law.at(scene, shape)[:, None, chosen]
    joints = [part.joint - 1] if part.joint else range(scene.axes)
    return np.stack([part.law.at(scene.unit_torque(joint), shape)[:, chosen] for joint in joints], axis=1)
