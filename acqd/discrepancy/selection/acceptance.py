"""Which finding is credible: evidence, relevance, chance, agreement, and the comparison with unnamed alternatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Regression
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.selection.accepted import Named
from acqd.discrepancy.selection.detectors.candidates import Detection
from acqd.discrepancy.selection.imitation import beyond_earlier
from acqd.discrepancy.selection.ranking import Finding, Support
from acqd.discrepancy.selection.reference_spread import beyond_reference_spread, knows_spread
from acqd.discrepancy.selection.relevance import relevant
from acqd.discrepancy.selection.shape_fit import fit_shape
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library


@dataclass(frozen=True, slots=True)
class View:
    """Rows and a regression that findings are judged in."""

    design: Design
    regression: Regression
    prior_findings: Sequence[Named]
    """Effects whose shape may be wrong in these rows."""
    detections: dict[str, Detection]
    """By key of their candidates."""
    complete: bool
    """All rows of the design take part, so that shapes can be refined."""


def worth(finding: Finding) -> float:
    """Order of findings: the smaller one of evidence and held-out gain; less for detected effects.

    Logged torques are a separate witness: their part counts on both sides.
    """
    return min(discounted(finding), (finding.supported().held_out + finding.at_joints) / _price(finding))


def discounted(finding: Finding) -> float:
    """Evidence; less for effects that were detected by searching the residual."""
    return finding.evidence / _price(finding)


def _price(finding: Finding) -> float:
    return THRESHOLDS.detected_worth if finding.candidate.detected else 1.0


def credible(view: View, finding: Finding, limit: float) -> bool:
    """Whether a finding passes all hurdles; `limit`: surprise that clean recordings exceed rarely."""
    return not missing(view, finding, limit)


def missing(view: View, finding: Finding, limit: float) -> list[str]:
    """The hurdles that a finding does not pass, in words."""
    support = finding.supported()
    least = least_evidence(view, finding)
    failed = []
    if finding.evidence <= least:
        needed = (
            f"evidence above {least:.0f}" if np.isfinite(least) else "more evidence for something that was searched"
        )
        failed.append(needed)
    if not relevant(view.design, finding):
        failed.append("a size that matters")
    if not beyond_earlier(view.design, view.prior_findings, finding):
        failed.append("more power than an error of the earlier effects may leave")
    if not (support.surprise > limit or _seen_at_joints(view, finding) or _unanimous(view, finding)):
        failed.append(
            f"more agreement than by chance (surprise {support.surprise:.1f} of {limit:.1f}): more recordings"
        )
    if support.held_out <= 0:
        failed.append("a gain on recordings that did not take part")
    if not _smaller_error(support):
        failed.append("a smaller error in W")
    if support.consistency < THRESHOLDS.consistent_share:
        failed.append(f"agreement of the recordings ({support.consistency:.0%})")
    if not failed and not _changed(view, finding):
        failed.append("more than what unchanged sessions of the reference differ by")
    return failed


def _changed(view: View, finding: Finding) -> bool:
    """Whether the recordings in question differ from the reference more than its sessions among each other."""
    if finding.candidate.detected or _seen_at_joints(view, finding):  # these have tests against the reference
        return True
    return beyond_reference_spread(view.design, view.regression, finding)


def _smaller_error(support: Support) -> bool:
    """Whether the error in W does not grow.

    Next to a constant load that no effect explains yet, a friction seems to make the error larger. Then the error
    about the mean of every block decides, and it must clearly fall.
    """
    return support.plain.sign() >= 0 or support.varying.sign() > 0


def _seen_at_joints(view: View, finding: Finding) -> bool:
    """Whether logged torques alone show the effect, its parameters paid for."""
    price = finding.candidate.size * float(np.log(max(view.design.blocks.rows.sum(), 2.0)))
    return finding.at_joints > THRESHOLDS.joint_evidence + price


def least_evidence(view: View, finding: Finding) -> float:
    """Evidence that a finding must exceed; infinite for an effect that was detected too weakly."""
    candidate = finding.candidate
    least = float(THRESHOLDS.least_evidence)
    if candidate.detected:
        if finding.evidence <= THRESHOLDS.detected_evidence:
            return np.inf
        least = max(THRESHOLDS.detected_evidence, view.detections[candidate.key].reference_evidence())
    for earlier in view.prior_findings:
        near = candidate.id in ("", earlier.id) or candidate.id in library()[earlier.id].neighbours
        share = THRESHOLDS.neighbour_share if near else THRESHOLDS.later_share
        least = max(least, share * earlier.finding.evidence)
    return least


def leading(view: View, named: list[Finding], limit: float) -> Finding | None:
    """The effect to name, of findings in the order of their worth; None if no effect is credible.

    A credible finding shows that something is there. What it is, is the question of evidence: an effect that explains
    clearly more has the better claim to the name. If its held-out gain is the larger one too, agreement of most
    recordings suffices; else it must be credible itself. The guard on held-out recordings follows.
    """
    first = next((finding for finding in named if credible(view, finding, limit)), None)
    if first is None:
        return None
    place = named.index(first)
    better = [
        finding for number, finding in enumerate(named)
        if not finding.candidate.detected and outdone(first, finding)
        and (_agrees(view, finding) if number < place else credible(view, finding, limit))
    ]  # fmt: skip
    return max(better, key=lambda finding: finding.evidence, default=first)


def equal_to(view: View, gate: Gate, alternative: Finding, named: list[Finding]) -> Finding | None:
    """The effect that explains as much as a credible unnamed alternative, in most recordings.

    The alternative shows that something is there; a name that explains as much is the better explanation.
    """
    tried = set()
    for finding in sorted(named, key=lambda finding: -finding.evidence):
        if finding.candidate.detected or finding.candidate.id in tried:
            continue
        if _agrees(view, finding) and serious(view.design, finding):
            if not refuted(view, gate, finding, alternative):
                return finding
            tried.add(finding.candidate.id)  # its other places and shapes explain less
    return None


def _agrees(view: View, finding: Finding) -> bool:
    agree = finding.supported().consistency >= THRESHOLDS.consistent_share
    matters = relevant(view.design, finding) and beyond_earlier(view.design, view.prior_findings, finding)
    return agree and finding.evidence > least_evidence(view, finding) and matters


def serious(design: Design, finding: Finding) -> bool:
    """Whether a finding is an alternative explanation at all."""
    support = finding.supported()
    smaller = support.plain.total > 0 or support.varying.sign() > 0
    return support.held_out > 0 and smaller and relevant(design, finding)


def _unanimous(view: View, finding: Finding) -> bool:
    """Nearly all recordings agree: few recordings cannot surprise otherwise.

    Without sessions of a reference, whose spread is the scale, few recordings must be loud.
    """
    support, least = finding.supported(), THRESHOLDS.unanimous_evidence
    if support.acting >= THRESHOLDS.unanimous_recordings:
        return support.consistency >= THRESHOLDS.unanimous_share and finding.evidence > least
    least = least if knows_spread(view.design) else THRESHOLDS.few_evidence
    agree = support.acting >= THRESHOLDS.few_recordings and support.consistency == 1.0
    gained = support.held_out > THRESHOLDS.few_held_out_share * finding.evidence
    return agree and gained and finding.evidence > least


def refuted(view: View, gate: Gate, best: Finding, alternative: Finding) -> bool:
    """Whether an unnamed alternative explains clearly more than the best effect with a fitted shape.

    Scanned shapes are coarse, and their columns hold for a small effect.
    """
    earlier = view.prior_findings
    if not outdone(best, alternative, earlier):
        return False
    coarse = alternative.evidence <= THRESHOLDS.coarse_factor * best.evidence
    if not view.complete or best.candidate.detected or not coarse:
        return True
    fitted = fit_shape(view.design, view.regression, gate.open, best, None)
    return outdone(replace(best, evidence=fitted.finding.evidence), alternative, earlier)


def outdone(best: Finding, alternative: Finding, others: Sequence[Named] = ()) -> bool:
    """Whether an alternative explains clearly more, where the effects `others` are part of the explanation.

    What the columns of all these effects get wrong, a flexible alternative explains beside the truth.
    """
    if best.candidate.detected:  # anything that predicts half as much is the better explanation
        return alternative.evidence > THRESHOLDS.predictive_share * best.evidence
    explained = best.evidence + sum(other.finding.evidence for other in others)
    margin = THRESHOLDS.alternative_margin + THRESHOLDS.alternative_share * explained
    return alternative.evidence > best.evidence + margin
