"""The table of hypotheses: who leads, by how much, and what the others lack (ADR 26).

One margin decides everywhere. Evidence counts above chance, 2 log(kinds / pi) for so many kinds of hypotheses, and
above what the columns of effects that are known already get wrong: where these are wrong by a share kappa, they leave
up to kappa^2 of what they explain to a hypothesis whose power is proportional to theirs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.white_rows import white_rows
from acqd.discrepancy.selection.accepted import Hypothesis, power_in_question
from acqd.discrepancy.selection.detectors.candidates import Detection
from acqd.discrepancy.selection.ranking import Finding, Rows
from acqd.discrepancy.selection.spread import beyond_sessions, power_rms
from acqd.discrepancy.selection.standing import proportional
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance
from acqd.models.effects import library

USUAL = "more than what unchanged sessions of the reference differ by"
"""What a hypothesis lacks that is no more than such a difference."""


def kinds_of(candidates: Sequence[Candidate]) -> int:
    """Number of kinds of hypotheses: effects, and laws without a name."""
    return len({candidate.kind for candidate in candidates})


def margin(rows: Rows, gate: Floats, finding: Finding, known: Sequence[Finding], kinds: int) -> float:
    """Evidence that a finding must exceed beside effects that are known."""
    return by_chance(kinds) + THRESHOLDS.column_error**2 * left_by(rows.design, gate, finding, known)


def left_by(design: Design, gate: Floats, finding: Finding, known: Sequence[Finding]) -> float:
    """Evidence of known effects that a finding could take over if their columns were wrong in the worst way.

    A known effect that draws p explains E. Columns wrong by a share e(t) leave e p, of which a finding that draws c
    explains at most (sum |e p c|)^2 / sum c^2: the share (sum |p c|)^2 / (sum p^2 sum c^2) of e^2 E.
    """
    if not known:
        return 0.0
    mine = white_power(design, finding, gate)
    return sum(max(other.evidence, 0.0) * proportional(mine, white_power(design, other, gate)) for other in known)


def refines(one: Candidate, other: Candidate) -> bool:
    """Whether an effect is another one of the same quantity with a shape that is free.

    At an end of the shape the first is the second: gears that never warm up are stiff.
    """
    if not (one.id and other.id):
        return False
    first, second = library()[one.id], library()[other.id]
    return bool(first.usual) and first.usual == second.usual and bool(first.bounds) and not second.bounds


def taken_by_shape(of_columns: float) -> float:
    """Evidence that a free shape takes on average of what wrong columns leave at most (`of_columns`, a 95 % limit).

    What they leave has either sign along the shape, which follows where that helps: the mean of max(0, N(0, s^2)).
    """
    return of_columns / THRESHOLDS.interval_width / float(np.sqrt(2 * np.pi))


def white_power(design: Design, finding: Finding, gate: Floats) -> Floats:
    """[white rows] of the power of a finding."""
    blocks = power_in_question(design, finding, gate)
    parts = [part for part, open_ in zip(design.parts, gate, strict=True) if open_]
    return np.concatenate([white_rows(design.whitener, part, own) for part, own in zip(parts, blocks, strict=True)])


def judged(
    rows: Rows,
    gate: Floats,
    finding: Finding,
    known: Sequence[Finding],
    kinds: int,
    scanned: Finding | None = None,
    detection: Detection | None = None,
) -> Hypothesis:
    """A finding by itself: whether something is there at all.

    `scanned`: the same with columns over both sides, if those of the finding are fitted to one. `detection`: the search
    in the residual that the finding comes from.
    """
    design = rows.design
    least = margin(rows, gate, finding, known, kinds)
    if finding.evidence <= least:  # nothing that would have to be compared with the reference
        beyond = np.inf
    elif detection is None or detection.refinable:
        beyond = beyond_sessions(design, rows.regression, scanned or finding, gate)
    else:
        beyond = finding.evidence  # above what the same search gains in the reference
    rms_W, least_W = power_rms(design, finding), THRESHOLDS.least_share_of_range * design.columns.dynamic_range
    missing = []
    if finding.evidence <= least:
        missing.append(f"evidence above {least:.0f}")
    if beyond <= by_chance(kinds):
        missing.append(USUAL)
    if rms_W <= least_W:
        missing.append(f"a size that matters ({least_W:.2g} W while acting)")
    if not possible(rows, gate, finding, known, kinds):
        missing.append("a size within its physical bounds")
    status = "refused" if missing else "candidate"
    return Hypothesis(finding, least, beyond, rms_W, least_W, status, tuple(missing))  # type: ignore[arg-type]


def possible(rows: Rows, gate: Floats, finding: Finding, known: Sequence[Finding], kinds: int) -> bool:
    """Whether chance, and what columns get wrong, explain all that the data ask for at and beyond physical bounds.

    More than that is a sign of another cause, or of a wrong description. A loss of an idle joint is at its bound of
    zero in half of all fits of all joints.
    """
    return finding.forbidden <= margin(rows, gate, finding, [*known, finding], kinds)


def best_of_each(findings: Sequence[Finding]) -> list[Finding]:
    """The best finding of every effect and of every unnamed alternative, the largest evidence first."""
    best: dict[str, Finding] = {}
    for finding in findings:
        name = finding.candidate.id or finding.candidate.label
        if name not in best or finding.evidence > best[name].evidence:
            best[name] = finding
    return sorted(best.values(), key=lambda finding: -finding.evidence)
