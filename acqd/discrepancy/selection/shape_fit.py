"""The shape of an effect between scanned values, and its columns at the secant slope of the fitted size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.selection.detectors.candidates import Detection
from acqd.discrepancy.selection.ranking import Finding, Rows, ranked
from acqd.models.effects import library
from acqd.models.effects.effect import Effect, effect_rows, effect_rows_at
from acqd.models.effects.places import Place, Shape, Variant
from acqd.models.effects.scene import Scene

_EVALUATIONS = 7
_SECANT_ITERATIONS = 3


@dataclass(frozen=True, slots=True)
class ShapeFit:
    """Rows that hold the fitted columns, the finding on them, and the shape."""

    rows: Rows
    finding: Finding
    shape: dict[str, float]


@dataclass(frozen=True, slots=True)
class _Columns:
    """Columns of an effect at a place, in the segments of a gate."""

    design: Design
    effect: Effect
    place: Place
    open: frozenset[int]
    """Segments."""

    @property
    def kept(self) -> _Columns:
        """In the segments whose scenes are kept, if the gate has any: a quarter of an hour determines a shape."""
        return replace(self, open=self.open & self.design.columns.scenes.kept or self.open)

    def gate(self, gate: Floats) -> Floats:
        """[blocks] of a gate those in open segments."""
        return np.asarray(gate * [part.segment in self.open for part in self.design.parts])

    def __call__(self, shape: Shape, coefficients: Floats | None = None) -> list[Floats]:
        """[T, parameters] W per unit, per segment: of an effect of that size, or of a small one."""
        return self.of_shapes([shape], coefficients)[0]

    def of_shapes(self, shapes: Sequence[Shape], coefficients: Floats | None) -> list[list[Floats]]:
        """The same of several shapes, for which every scene is made once."""
        columns: list[list[Floats]] = [[] for _ in shapes]
        for k, segment in enumerate(self.design.columns.segments):
            scene = self.design.columns.scenes[k] if k in self.open else None
            for of_shape, shape in zip(columns, shapes, strict=True):
                of_shape.append(
                    np.zeros((len(segment.P), len(self.place.parameters)))
                    if scene is None
                    else self._rows(scene, shape, coefficients)
                )
        return columns

    def _rows(self, scene: Scene, shape: Shape, coefficients: Floats | None) -> Floats:
        chosen = list(self.place.columns)
        mix = np.eye(len(chosen)) if self.place.mix is None else self.place.mix
        if coefficients is None:
            return np.asarray(effect_rows(self.effect, scene, shape, chosen) @ mix)
        return np.asarray(effect_rows_at(self.effect, scene, shape, chosen, mix @ coefficients) @ mix)


def fit_shape(rows: Rows, gate: Floats, finding: Finding, detection: Detection | None) -> ShapeFit:
    """The finding with columns that belong to its parameters, its shape fitted between scanned neighbours."""
    candidate = finding.candidate
    assert candidate.variant is not None
    shape = dict(candidate.variant.shape)
    if detection is not None and not detection.refinable:
        return ShapeFit(rows, finding, shape)
    effect, place = library()[candidate.id], candidate.variant.place
    columns = columns_of(rows.design, effect, place, gate)
    design, indices = rows.design.with_columns(columns.kept(shape))
    own_place = Place(place.where, tuple(range(len(indices))), place.parameters)
    own = replace(
        candidate, indices=indices, variant=Variant(own_place, own_place.columns, shape), detected=False,
        fitted=Variant(place, place.columns, shape),
    )  # fmt: skip
    rows = rows.on(design)
    if shape and effect.bounds:
        rows, shape = _searched(rows, gate, own, columns.kept)
        own = replace(own, fitted=Variant(place, place.columns, shape))
    rows, found = at_secant_slope(rows, gate, own, columns, shape)
    return ShapeFit(rows, replace(found or finding, candidate=own), shape)


def at_secant_slope(
    rows: Rows, gate: Floats, own: Candidate, columns: _Columns, shape: Shape
) -> tuple[Rows, Finding | None]:
    """A candidate whose columns are those of a torque of the fitted size, and rows with them.

    None where the candidate does not act. `rows` has columns of a small size in the segments whose scenes are kept: of
    long recordings, the size is found there, and the columns of all segments are computed once.
    """
    some, torque = columns.kept, columns.effect.acts_on == "torque"
    among = some.gate(gate)
    found = next(iter(ranked(rows, among, [own])), None)
    for _ in range(_SECANT_ITERATIONS if torque and found is not None else 0):
        assert found is not None
        rows = rows.on(rows.design.with_replaced(own.indices, some(shape, found.coefficients)))
        found = next(iter(ranked(rows, among, [own])), None)
        if found is None:
            break
    if some.open != columns.open:
        size = found.coefficients if torque and found is not None else None
        rows = rows.on(rows.design.with_replaced(own.indices, columns(shape, size)))
        found = next(iter(ranked(rows, gate, [own])), None)
    return rows, found


def columns_of(design: Design, effect: Effect, place: Place, gate: Floats) -> _Columns:
    """Columns of an effect by its shape, in the segments where `gate` [blocks] is open."""
    return _Columns(
        design, effect, place, frozenset(part.segment for part, open_ in zip(design.parts, gate, strict=True) if open_)
    )


def _searched(rows: Rows, gate: Floats, own: Candidate, columns: _Columns) -> tuple[Rows, dict[str, float]]:
    """The shape that explains most, by Brent's bounded search, and rows with its columns.

    All shapes compete at the secant slope of the scanned one: columns of a small effect would draw a large friction
    wrong, and the shape would make up for that.
    """
    assert own.variant is not None
    name, value = next(iter(own.variant.shape.items()))
    low, high = _between(columns.effect.shapes, name, value, columns.effect.bounds[name])
    among = columns.gate(gate)
    _, scanned = at_secant_slope(rows, gate, own, columns, own.variant.shape)
    size = None if scanned is None else scanned.coefficients

    def negative_evidence(trial: float) -> float:
        changed = rows.on(rows.design.with_replaced(own.indices, columns({name: trial}, size)))
        at_trial = replace(own, fitted=Variant(columns.place, columns.place.columns, {name: trial}))
        found = ranked(changed, among, [at_trial])
        return -found[0].evidence if found else 0.0

    best = minimize_scalar(negative_evidence, bounds=(low, high), method="bounded", options={"maxiter": _EVALUATIONS})
    shape = {name: float(best.x) if best.fun < negative_evidence(value) else value}
    return rows.on(rows.design.with_replaced(own.indices, columns(shape))), shape


def _between(
    shapes: tuple[Mapping[str, float], ...], name: str, value: float, bounds: tuple[float, float]
) -> tuple[float, float]:
    values = sorted({float(shape[name]) for shape in shapes})
    at = values.index(value)
    low = values[at - 1] if at else bounds[0]
    high = values[at + 1] if at + 1 < len(values) else bounds[1]
    return low, high
