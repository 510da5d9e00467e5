"""The shape of an effect between the scanned values, and its columns as large as the effect turned out to be."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Candidate, Design, extend, replace_columns
from acqd.discrepancy.regression.gram import Model
from acqd.discrepancy.selection.detectors.candidates import Detected
from acqd.discrepancy.selection.ranking import Finding, rank_pooled
from acqd.models.effects import library
from acqd.models.effects.effect import Effect, effect_rows, effect_rows_at
from acqd.models.effects.places import Place, Shape, Variant
from acqd.models.effects.scene import Scene

_EVALUATIONS = 7
_SECANT_ITERATIONS = 3


@dataclass(frozen=True, slots=True)
class _Columns:
    """Of one effect at one place, where the gate is open."""

    design: Design
    effect: Effect
    place: Place
    open: frozenset[int]
    """Stretches."""

    def __call__(self, shape: Shape, theta: Floats | None = None) -> list[Floats]:
        """Per stretch, W per unit of each parameter; for an effect as large as `theta`, or a very small one."""
        return [
            self._rows(scene, shape, theta) if k in self.open else np.zeros((scene.rows, len(self.place.parameters)))
            for k, scene in enumerate(self.design.scenes)
        ]

    def _rows(self, scene: Scene, shape: Shape, theta: Floats | None) -> Floats:
        mix = np.eye(len(self.place.columns)) if self.place.mix is None else self.place.mix
        if theta is None:
            return np.asarray(effect_rows(self.effect, scene, shape)[:, list(self.place.columns)] @ mix)
        return np.asarray(effect_rows_at(self.effect, scene, shape, self.place.columns, mix @ theta) @ mix)


def refine(
    design: Design, model: Model, gate: Floats, finding: Finding, detected: Detected | None
) -> tuple[Finding, dict[str, float]]:
    """The finding with columns of its own (one per parameter), its shape searched between neighbours."""
    candidate = finding.candidate
    assert candidate.variant is not None
    shape = dict(candidate.variant.shape)
    if detected is not None and detected.ripple is None:
        return finding, shape
    effect, place = library()[candidate.id], candidate.variant.place
    open_ = frozenset(part.segment for part, own in zip(design.parts, gate, strict=True) if own)
    rows = _Columns(design, effect, place, open_)
    places = extend(design, rows(shape))
    own = Candidate(candidate.id, candidate.label, places, Variant(
        type(place)(place.where, tuple(range(len(places))), place.parameters), tuple(range(len(places))), shape
    ))  # fmt: skip
    if shape and effect.bounds:
        shape = _searched(design, model, gate, own, rows, finding.drop)
    found = rank_pooled(design, model, gate, [own])
    for _ in range(_SECANT_ITERATIONS if effect.acts_on == "torque" else 0):
        if found:
            replace_columns(design, places, rows(shape, found[0].coefficients))
            found = rank_pooled(design, model, gate, [own])
    again = found[0] if found else replace(finding, candidate=own)
    return replace(
        finding, candidate=own, coefficients=again.coefficients, drop=again.drop, evidence=again.evidence
    ), shape


def _searched(
    design: Design, model: Model, gate: Floats, own: Candidate, rows: _Columns, drop: float
) -> dict[str, float]:
    """The shape that explains most; the candidate's columns are left as that shape has them."""
    assert own.variant is not None
    name, value = next(iter(own.variant.shape.items()))
    low, high = _between(rows.effect.shapes, name, value, rows.effect.bounds[name])

    def left(trial: float) -> float:
        replace_columns(design, own.places, rows({name: trial}))
        found = rank_pooled(design, model, gate, [own])
        return -found[0].drop if found else 0.0

    best = minimize_scalar(left, bounds=(low, high), method="bounded", options={"maxiter": _EVALUATIONS})
    shape = {name: float(best.x) if -best.fun > drop else value}
    replace_columns(design, own.places, rows(shape))
    return shape


def _between(shapes: tuple[object, ...], name: str, value: float, bounds: tuple[float, float]) -> tuple[float, float]:
    values = sorted({float(each[name]) for each in shapes})  # type: ignore[index]
    at = values.index(value)
    low = values[at - 1] if at else bounds[0]
    high = values[at + 1] if at + 1 < len(values) else bounds[1]
    return low, high
