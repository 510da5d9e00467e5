"""The smallest size of an effect that passes the selection's rules with a power of 95 %, by the loop's own columns.

An effect of size theta has the product h = s theta with the residual, s the precision of its size with all other
columns projected out. Its estimate scatters by white noise, 1/s, and by what unchanged sessions differ by (`spread`).
Each rule of the selection asks for a least size; the estimate stays above with a probability of 95 % from 1.645
standard errors more (Neyman and Pearson 1933). The largest of these sizes decides, and its rule says what would help:
more rows, more sessions of the reference, or nothing because smaller sizes do not matter (ADR 48).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtri

from acqd import student
from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import TwoWitnesses
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.least_squares import Competition
from acqd.discrepancy.selection.judging import kinds_of
from acqd.discrepancy.selection.ranking import Finding, Rows, acts, bounds_of, part_of, posterior, prior_of
from acqd.discrepancy.selection.spread import AS_IT_IS, More, power_rms, sessions_of, variances_of_sizes
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance

POWER = 0.95
"""Probability with which an effect of the stated size passes the rules."""
_SURE = float(ndtri(POWER))
LimitedBy = Literal["rows", "sessions", "relevance", "bounds", "motion"]
"""Noise of the rows; differences of unchanged sessions; sizes that do not matter; physics; columns that never act."""


@dataclass(frozen=True, slots=True, eq=False)
class Smallest:
    """What recordings show of an effect at a place, in a shape."""

    candidate: Candidate
    size: float | None
    """In the unit of the effect's parameter; None: no possible size can be named."""
    rms_W: float | None
    """While the effect acts, at that size."""
    limited_by: LimitedBy
    precision: float
    """Of the size, inverse variance in white noise, with every other column projected out."""
    from_torques: float = 0.0
    """Share of the precision that logged torques add."""

    @property
    def parameter(self) -> tuple[str, str]:
        """Name and unit."""
        assert self.candidate.variant is not None
        parameter = self.candidate.variant.place.parameters[0]
        return parameter.name, parameter.unit

    @property
    def shape(self) -> Mapping[str, float]:
        """Parameters that are not linear."""
        assert self.candidate.variant is not None
        return self.candidate.variant.shape


def single_effects(rows: Rows) -> list[Candidate]:
    """Effects of one parameter: what differs at several places at once differs at each of them."""
    return [each for each in rows.design.columns.candidates if each.id and each.size == 1]


def competition_of(
    rows: Rows, gate: Floats, candidates: list[Candidate], longer: float, more: More = AS_IT_IS
) -> tuple[Indices, Competition]:
    """Columns of candidates, and their Schur complement under a gate [blocks] that counts `longer` times."""
    used = np.unique(np.concatenate([each.indices for each in candidates]))
    reference = 1 - rows.design.columns.in_question
    return used, rows.regression.compete(used, gate, 1 + (longer - 1) * gate + (more.reference - 1) * reference)


def smallest_sizes(rows: Rows, gate: Floats, longer: float = 1.0, more: More = AS_IT_IS) -> list[Smallest]:
    """Of all effects with one parameter under a gate [blocks]; `longer`: times the recorded minutes.

    More minutes say more of what differs within them; the level of the session stays as uncertain as the prior says.
    Empty where no effect has columns.
    """
    candidates = single_effects(rows)
    if not candidates:
        return []
    design, weights = rows.design, longer * gate
    used, competition = competition_of(rows, gate, candidates, longer, more)
    units, precisions = [], []
    for candidate in candidates:
        positions = np.searchsorted(used, candidate.indices)
        schur, _ = part_of(competition.schur, competition.products, positions, candidate)
        precision = from_power = rows.learning_rate * float(schur[0, 0]) if acts(schur) else 0.0
        at_joints = design.at_joints(candidate, weights) if precision else None
        if at_joints is not None:
            precision += float(at_joints.precision[0, 0])
        both = TwoWitnesses(from_power, precision - from_power) if precision > from_power > 0 else None
        units.append(Finding(candidate, np.ones(1), np.zeros(1), 0.0, witnesses=both))
        precisions.append(precision)
    spreads = [(0.0, 1.0)] * len(units)  # without a reference to differ from
    if sessions_of(design.parts, in_question=False):
        spreads = variances_of_sizes(design, rows.regression, units, weights, more)
    kinds = kinds_of(design.columns.candidates)
    return [
        _smallest(design, unit, precision, spread, kinds)
        if precision
        else Smallest(unit.candidate, None, None, "motion", 0.0)
        for unit, precision, spread in zip(units, precisions, spreads, strict=True)
    ]


def _smallest(design: Design, unit: Finding, precision: float, spread: tuple[float, float], kinds: int) -> Smallest:
    """Of a finding of size 1; `spread`: variance between sessions, and its degrees of freedom."""
    candidate = unit.candidate
    variance, freedom = spread
    error = float(np.sqrt(1 / precision + variance))
    rms = power_rms(design, unit)
    least_W = THRESHOLDS.least_share_of_range * design.columns.dynamic_range
    both = unit.witnesses
    from_torques = 0.0 if both is None else both.torques / (both.power + both.torques)
    improbable = float(student.isf(np.exp(-by_chance(kinds) / 2) / 2, freedom))
    least: dict[LimitedBy, float] = {
        "rows": _with_evidence(design, candidate, precision, by_chance(kinds)),
        "sessions": improbable * float(np.sqrt(variance)),
        "relevance": least_W / max(rms, 1e-12),
    }
    limit = max(least, key=lambda rule: least[rule])
    size = least[limit] + _SURE * error
    low, high = bounds_of(candidate)
    if size >= max(-float(low[0]), float(high[0])):
        return Smallest(candidate, None, None, "bounds", precision, from_torques)
    return Smallest(candidate, size, size * rms, limit, precision, from_torques)


def _with_evidence(design: Design, candidate: Candidate, precision: float, least: float) -> float:
    """The size whose expected product has the least evidence, the choice among places and shapes paid."""
    D, S = prior_of(design, candidate), np.array([[precision]])
    low, high = np.array([-np.inf]), np.array([np.inf])
    asked = least + 2 * np.log(candidate.tried)

    def short(z: float) -> float:
        _, _, evidence = posterior(S, np.array([z * np.sqrt(precision)]), D, low, high)
        return float(evidence - asked)

    upper = 10.0
    while short(upper) < 0:
        upper *= 2
    return float(brentq(short, 0.0, upper)) / float(np.sqrt(precision))
