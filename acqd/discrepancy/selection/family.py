"""Families: effects whose power is nearly the same in these recordings. The data cannot tell them apart.

A family is one finding. Its name is that of the member which most resampled sets of recordings prefer: the member with
the largest evidence in all recordings may be another one, by a hair.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.selection.accepted import Named, Tracing
from acqd.discrepancy.selection.ranking import Finding, rank
from acqd.discrepancy.selection.shape_fit import fit_shape
from acqd.discrepancy.selection.uncertainty import confidence
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library


def family(tracing: Tracing, named: Named) -> list[Finding]:
    """Alternatives whose power is nearly the power of the effect, in all rows under the gate."""
    design = tracing.design
    mine = _power(design, named.finding, named.gate)
    effects = [finding for finding in named.alternatives if finding.candidate.id]
    alike = [_correlation(mine, _power(design, finding, named.gate)) for finding in effects]
    return [finding for finding, r in zip(effects, alike, strict=True) if r > THRESHOLDS.family_correlation]


def likeliest_member(tracing: Tracing, named: Named, seed: int) -> Named:
    """The member of the effect's family that most resampled sets of recordings prefer; a tie leaves the effect."""
    kin = {finding.candidate.id: finding for finding in family(tracing, named)}
    if not kin or named.finding.candidate.detected:
        return named
    own, alternatives = confidence(tracing, named, seed)
    name, share = next(((name, share) for name, share in alternatives if name in kin), ("", 0.0))
    return _renamed(tracing, named, kin[name]) if share > own else named


def _renamed(tracing: Tracing, named: Named, member: Finding) -> Named:
    """Another member in the place of the effect, with a fitted shape; the design gets the member's columns.

    The effect as it is if the member does not act in these recordings, given the other effects.
    """
    regression = tracing.regression.without(named.key)
    fitted = fit_shape(replace(tracing.design, witness=named.witness), regression, named.gate.open, member, None)
    design = fitted.design
    ranked = rank(design, regression.on(design.blocks), named.gate.open, [fitted.finding.candidate])
    if not ranked:
        return named
    found = ranked[0].candidate
    assert found.variant is not None
    tracing.design = replace(design, witness=tracing.design.witness)
    others = [finding for finding in named.alternatives if finding.candidate.id != member.candidate.id]
    shape = fitted.shape | library()[found.id].fixed_shape(design.columns.scenes)
    place = (found.fitted or found.variant).place
    return Named(ranked[0], named.gate, place, shape, [named.finding, *others], named.witness)


def _power(design: Design, finding: Finding, gate: Gate) -> Floats:
    """[rows] W of a finding under a gate."""
    weights = finding.candidate.weights(finding.coefficients)
    open_ = [part for part, own in zip(design.parts, gate.open, strict=True) if own]
    return np.concatenate([design.values(part.segment, finding.candidate.places, part.own) @ weights for part in open_])


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / max(float(np.sqrt((a @ a) * (b @ b))), 1e-12))
