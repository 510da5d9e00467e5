"""The shape of an effect between the scanned values, and its columns as its parameters have them."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from acqd.discrepancy.derive import Derived
from acqd.discrepancy.design import Candidate, Design, extend, replace_columns
from acqd.discrepancy.evidence import Model
from acqd.discrepancy.search import Finding, quick
from acqd.models.effects import library
from acqd.models.effects.effect import Variant, effect_rows
from acqd.robot.description import Floats

_EVALUATIONS = 7


def refine(
    design: Design, model: Model, gate: Floats, finding: Finding, derived: Derived | None
) -> tuple[Finding, dict[str, float]]:
    """The finding with columns of its own (one per parameter), its shape searched between neighbours."""
    candidate = finding.candidate
    assert candidate.variant is not None
    shape = dict(candidate.variant.shape)
    if derived is not None:
        return finding, shape
    effect = library()[candidate.id]
    place = candidate.variant.place
    open_ = sorted({part.stretch for part, own in zip(design.parts, gate, strict=True) if own})

    def rows(trial: dict[str, float]) -> list[Floats]:
        found = []
        for k, scene in enumerate(design.scenes):
            if k in open_:
                columns = effect_rows(effect, scene, trial)[:, list(place.columns)]
                found.append(columns if place.mix is None else columns @ place.mix)
            else:
                found.append(np.zeros((scene.rows, len(place.parameters))))
        return found

    places = extend(design, rows(shape))
    own = Candidate(candidate.id, candidate.label, places, Variant(
        type(place)(place.where, tuple(range(len(places))), place.parameters), tuple(range(len(places))), shape
    ))  # fmt: skip
    if shape and effect.bounds:
        name, value = next(iter(shape.items()))
        low, high = _between(effect.shapes, name, value, effect.bounds[name])

        def left(trial: float) -> float:
            replace_columns(design, places, rows({name: trial}))
            found = quick(design, model, gate, [own])
            return -found[0].drop if found else 0.0

        best = minimize_scalar(left, bounds=(low, high), method="bounded", options={"maxiter": _EVALUATIONS})
        value = float(best.x) if -best.fun > finding.drop else value
        replace_columns(design, places, rows({name: value}))
        shape = {name: value}
    again = quick(design, model, gate, [own])
    return (
        Finding(
            own,
            again[0].coefficients,
            again[0].drop,
            again[0].evidence,
            finding.gains,
            finding.plain,
            finding.acting,
            finding.consistency,
            finding.surprise,
        ),
        shape,
    )


def _between(shapes: tuple[object, ...], name: str, value: float, bounds: tuple[float, float]) -> tuple[float, float]:
    values = sorted({float(each[name]) for each in shapes})  # type: ignore[index]
    at = values.index(value)
    low = values[at - 1] if at else bounds[0]
    high = values[at + 1] if at + 1 < len(values) else bounds[1]
    return low, high
