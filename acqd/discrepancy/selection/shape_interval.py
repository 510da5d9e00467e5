"""How certain the fitted shape of an effect is, and what that costs the certainty of the effect's size.

A friction that dies out faster is larger for the same power: size and shape err together. The shape is fitted again
without every recording in turn, as the vertex of a parabola through the evidence of three shapes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Regression
from acqd.discrepancy.selection.accepted import Selected
from acqd.discrepancy.selection.ranking import bounds_of, solve_part, within
from acqd.discrepancy.selection.shape_fit import columns_of
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.models.effects.places import Variant

_FARTHEST = 3.0
"""Steps from the middle shape to which the parabola is believed."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Coefficients [k] for a set of recordings, their variances [k] in white noise, and the value of the shape."""

    coefficients: Floats
    variance: Floats
    drop: float
    """Reduction of the white squared error."""
    shape: float | None = None
    shape_variance: float = np.inf
    """In white noise; infinite where the evidence has no maximum."""


@dataclass(frozen=True, slots=True)
class Neighbours:
    """The effect at its shape and on both sides of it: three designs that differ in the effect's columns only."""

    selected: Selected
    values: tuple[float, float, float]
    """Of the shape parameter, at equal distances."""
    designs: tuple[Design, Design, Design]
    regressions: tuple[Regression, Regression, Regression]
    candidates: tuple[Candidate, Candidate, Candidate]

    @classmethod
    def of(cls, design: Design, regression: Regression, selected: Selected) -> Neighbours | None:
        """None for an effect whose shape was not fitted; `regression`: without the effect."""
        effect, candidate = library()[selected.id], selected.finding.candidate
        fitted = candidate.fitted
        if fitted is None or effect.detected or not effect.bounds or not fitted.shape:
            return None
        name, value = next(iter(fitted.shape.items()))
        low, high = effect.bounds[name]
        step = max(THRESHOLDS.shape_step * abs(value), 0.2 * THRESHOLDS.shape_step * (high - low))
        middle = float(np.clip(value, low + step, high - step))
        columns = columns_of(design, effect, fitted.place, selected.gate.open)
        values = middle - step, middle, middle + step
        coefficients = selected.finding.coefficients if effect.acts_on == "torque" else None
        at_each = columns.of_shapes([{name: trial} for trial in values], coefficients)
        designs = [design.with_replaced(candidate.indices, own) for own in at_each]
        candidates = [
            replace(candidate, fitted=Variant(fitted.place, fitted.place.columns, {name: trial})) for trial in values
        ]
        regressions = [regression.on(changed.blocks) for changed in designs]
        return cls(selected, values, tuple(designs), tuple(regressions), tuple(candidates))  # type: ignore[arg-type]

    def fit(self, weights: Floats) -> Fit:
        """Size and shape for blocks that count `weights` [blocks] times."""
        fits = [self._at(k, weights) for k in range(3)]
        drops = np.array([fit.drop for fit in fits])
        curvature = float(drops[0] - 2 * drops[1] + drops[2])
        step = self.values[1] - self.values[0]
        if curvature >= 0:  # no maximum here: the best of the three, and nothing known of its distance
            return replace(fits[int(drops.argmax())], shape=self.values[int(drops.argmax())])
        vertex = float(np.clip((drops[0] - drops[2]) / (2 * curvature), -_FARTHEST, _FARTHEST))
        low, middle, high = (fit.coefficients for fit in fits)
        slope = (high - low) / 2
        bend = (low - 2 * middle + high) / 2
        steps = 2 / -curvature  # variance of the vertex: the drop is twice the log-likelihood
        return Fit(
            middle + slope * vertex + bend * vertex**2, fits[1].variance + slope**2 * steps, float(drops.max()),
            self.values[1] + vertex * step, step**2 * steps,
        )  # fmt: skip

    def _at(self, number: int, weights: Floats) -> Fit:
        return fit_at(
            self.designs[number], self.regressions[number], self.candidates[number], self.selected.gate.open, weights
        )


def fit_at(design: Design, regression: Regression, candidate: Candidate, gate: Floats, weights: Floats) -> Fit:
    """The fit by generalised least squares within physical bounds."""
    competition = regression.compete(candidate.indices, gate, weights)
    schur, products = competition.schur, competition.products
    at_joints = design.at_joints(candidate, gate * weights)
    if at_joints is not None:
        schur, products = schur + at_joints.precision, products + at_joints.product
    coefficients = within(schur, products, solve_part(schur, products), *bounds_of(candidate))
    drop = float(2 * products @ coefficients - coefficients @ schur @ coefficients)
    return Fit(coefficients, np.diag(np.linalg.pinv(schur)), drop)
