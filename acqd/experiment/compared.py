"""Which causes the next recording has to decide between, and how much each is believed so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.causes.belief import NOTHING, OUTSIDE, Belief, shipped
from acqd.discrepancy.selection.judging import kinds_of
from acqd.discrepancy.selection.ranking import Finding, Rows, bounds_of, part_of, prior_of, ranked
from acqd.discrepancy.selection.spread import More, variances_of_sessions
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance
from acqd.errors import UserError
from acqd.experiment.contest import Cause
from acqd.models.effects import library

CAUSES = 6
"""That are compared at most."""
_FEWEST = 3
"""Where one leads."""


def require_known(names: tuple[str, ...]) -> None:
    """Raises UserError for an effect that the library does not have, and for clocks."""
    for name in names:
        if name not in library():
            raise UserError(f"--cause {name}: no such effect; the effects are {', '.join(library())}")
        if library()[name].acts_on == "clock":
            raise UserError(
                f"--cause {name}: no motion tells; another session has other clocks (acqd dataset build aligns)"
            )


def leading_causes(
    findings: list[Finding], rows: Rows, asked: tuple[str, ...], believed: Belief | None
) -> list[Finding]:
    """What the loop would not yet tell apart: its set of causes, and what is within the margin of the leader (ADR 26).

    The first few where only one is. Clocks are no causes here: another session has other clocks.
    """
    for name in asked:
        if all(finding.candidate.id != name for finding in findings):
            raise UserError(f"--cause {name}: has no column in these recordings; acqd robot ability says why")
    if asked:
        return [finding for finding in findings if finding.candidate.id in asked]
    causes = [each for each in findings if not each.candidate.id or library()[each.candidate.id].acts_on != "clock"]
    if not causes:
        raise UserError("nothing that acqd knows acts in these recordings; record another motion")
    least = causes[0].evidence - _margin(causes[0].evidence, rows)
    law = next((finding for finding in causes if not finding.candidate.id), None)
    members = () if believed is None else believed.members
    near = [
        finding for finding in causes
        if finding.evidence >= least or finding.candidate.id in members or (finding is law and OUTSIDE in members)
    ]  # fmt: skip
    if believed is not None:
        near.sort(key=lambda finding: -believed.probabilities.get(_label(finding), 0.0))
    return (near if len(near) > 1 else causes[:_FEWEST])[:CAUSES]


def beliefs(labels: Sequence[str], evidence: Floats, moved: float, believed: Belief | None) -> Floats:
    """[causes] what they are believed, among themselves: as the report says, and causes of one label by their evidence.

    Without a report's belief, by evidence alone, of which `moved` is one logit.
    """
    shares = np.exp((evidence - evidence.max()) / moved)
    if believed is not None and any(label in believed.probabilities for label in labels):
        least = min(believed.probabilities.values())
        for label in dict.fromkeys(labels):
            own = np.array([each == label for each in labels])
            shares[own] *= believed.probabilities.get(label, least) / shares[own].sum()
    return np.asarray(shares / shares.sum())


def share_compared(labels: Sequence[str], believed: Belief | None) -> float:
    """What the report believes of these causes together, where something has changed; 1 without a report's belief."""
    if believed is None:
        return 1.0
    least = min(believed.probabilities.values())
    together = sum(believed.probabilities.get(label, least) for label in set(labels))
    return together / max(1 - believed.probabilities.get(NOTHING, 0.0), together)


def causes_of(
    known: Rows, rows: Rows, exists: Floats, leading: list[Finding], believed: Belief | None, *, asked: bool
) -> tuple[Cause, ...]:
    """With the report's belief, or one by the calibrated scale of evidence (ADR 65).

    `known`: the recordings that exist; `rows`: those and the pieces, in which a law has other columns. `asked`: the
    engineer compares these causes only.
    """
    gate = known.design.columns.in_question
    evidence = np.array([finding.evidence for finding in leading])
    scale = shipped().scale
    moved = scale.chance + scale.columns * THRESHOLDS.column_error**2 * max(float(evidence.max()), 0.0)
    labels = [_label(finding) for finding in leading]
    shares = beliefs(labels, evidence, moved, believed) * (1.0 if asked else share_compared(labels, believed))
    units = [replace(finding, coefficients=_unit(finding)) for finding in leading]
    columns = known.design.columns
    days = len({columns.segments[part.segment].session for part in columns.parts if part.in_question})
    spreads, fewer = (
        variances_of_sessions(known.design, known.regression, units, gate, More(days=more))
        for more in (1.0, 1 + 1 / days)
    )
    by_key = {each.key: each for each in rows.design.columns.candidates}
    causes = []
    for finding, unit, spread, after, share in zip(leading, units, spreads, fewer, shares.tolist(), strict=True):
        candidate = by_key[finding.candidate.key]
        theta, single = unit.coefficients, len(unit.coefficients) == 1
        if not single and not candidate.id:  # the columns of a law follow the range of the motion
            theta = ranked(rows, rows.design.columns.in_question * exists, [candidate])[0].coefficients
        low, high = bounds_of(candidate)
        causes.append(
            Cause(
                candidate, candidate.weights(theta), float(finding.coefficients[0]) if single else 1.0,
                float(np.hypot(finding.deviation[0] if single else _along(known, gate, unit), spread[0] ** 0.5)),
                (float(low[0]), float(high[0])) if single else (-np.inf, np.inf),
                prior_of(known.design, finding.candidate), finding.evidence, share, spread, after,
            )
        )  # fmt: skip
    return tuple(causes)


def _label(finding: Finding) -> str:
    return finding.candidate.id or OUTSIDE


def _margin(evidence: float, rows: Rows) -> float:
    kinds = kinds_of(rows.design.columns.candidates)
    return by_chance(kinds) + THRESHOLDS.column_error**2 * max(evidence, 0.0)


def _unit(finding: Finding) -> Floats:
    """Coefficients of size 1; several parameters keep their fitted proportions."""
    return np.ones(1) if len(finding.coefficients) == 1 else finding.coefficients


def _along(rows: Rows, gate: Floats, finding: Finding) -> float:
    """Standard deviation of the common factor of several parameters."""
    used = np.unique(finding.candidate.indices)
    competition = rows.regression.compete(used, gate)
    own = np.searchsorted(used, finding.candidate.indices)
    schur, _ = part_of(competition.schur, competition.products, own, finding.candidate)
    return float((rows.learning_rate * finding.coefficients @ schur @ finding.coefficients) ** -0.5)
