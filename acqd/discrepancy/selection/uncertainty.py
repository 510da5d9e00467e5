"""How sure: which effect would be first with other recordings, and how far its parameters would move."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Candidate, Design
from acqd.discrepancy.regression.gram import Column, Model
from acqd.discrepancy.selection.ranking import rank_pooled, solve_part
from acqd.discrepancy.selection.stepwise import Gate, Named

_DRAWS = 40
_CONTENDERS = 6  # effects that take part
_WIDTH = 1.96


def confidence(design: Design, model: Model, named: Named, seed: int) -> tuple[float, list[tuple[str, float]]]:
    """Share of resampled sets of recordings in which the effect explains most, and the same of its rivals."""
    contenders = [named.finding, *named.rivals[:_CONTENDERS]]
    candidates = [finding.candidate for finding in contenders]
    first = dict.fromkeys([candidate.id for candidate in candidates], 0)
    random = np.random.default_rng(seed)
    for _ in range(_DRAWS):
        weights = _resampled(design, random)
        found = rank_pooled(design, model, named.gate.open, candidates, weights)
        if found:
            first[found[0].candidate.id] += 1
    total = max(sum(first.values()), 1)
    rivals = [(finding.candidate.id, first[finding.candidate.id] / total) for finding in named.rivals[:_CONTENDERS]]
    return first[named.id] / total, sorted(rivals, key=lambda rival: -rival[1])[:3]


def _resampled(design: Design, random: np.random.Generator) -> Floats:
    """How often each block counts when recordings are drawn with replacement, both sides on their own."""
    weights = np.zeros(len(design.parts))
    for in_question in (True, False):
        names = sorted({part.recording for part in design.parts if part.in_question == in_question})
        if names:
            counts = np.bincount(random.integers(0, len(names), len(names)), minlength=len(names))
            times = dict(zip(names, counts, strict=True))
            weights += [times[part.recording] if part.in_question == in_question else 0 for part in design.parts]
    return weights


def intervals(design: Design, model: Model, named: Named, gate: Gate) -> tuple[Floats, Floats]:
    """Coefficients and half widths of their 95 % intervals.

    Delete-one-recording jackknife; never narrower than white noise alone would have it. `model` holds everything
    else that was found.
    """
    candidate = named.finding.candidate
    whole, unit_torque = _fit(model, candidate, gate, np.ones(len(design.parts)))
    names = sorted({part.recording for part, open_ in zip(design.parts, gate.open, strict=True) if open_})
    left = []
    for name in names:
        weights = np.array([float(part.recording != name) for part in design.parts])
        left.append(_fit(model, candidate, gate, weights)[0])
    spread = np.zeros_like(whole)
    if len(left) > 2:
        around = np.array(left) - np.mean(left, axis=0)
        spread = (len(left) - 1) / len(left) * (around**2).sum(axis=0)
    return whole, _WIDTH * np.sqrt(spread + unit_torque)


def _fit(model: Model, candidate: Candidate, gate: Gate, weights: Floats) -> tuple[Floats, Floats]:
    found = model.compete(candidate.places, gate.open, weights)
    theta = solve_part(found.S, found.r)
    return theta, np.diag(np.linalg.pinv(found.S))


def others(design: Design, model: Model, named: Named) -> Model:
    """The model without one of the effects found."""
    own = set(named.finding.candidate.places.tolist())
    return Model(design.blocks, [c for c in model.columns if not (c.place in own and _same(c, named))])


def _same(column: Column, named: Named) -> bool:
    return bool(np.array_equal(column.gate, named.gate.open))
