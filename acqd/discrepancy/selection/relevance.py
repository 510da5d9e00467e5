"""Whether a finding is large enough to matter: in W, as a change of level, as a shift of clocks."""

from __future__ import annotations

import numpy as np

from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.residual.delay import single_delay
from acqd.discrepancy.selection.ranking import Finding
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.models.effects.clocks import slope


def relevant(design: Design, finding: Finding) -> bool:
    """Whether the effect is more than a trace of power while it acts, or more than a difference of two alignments."""
    candidate = finding.candidate
    weights = candidate.weights(finding.coefficients)
    columns = design.columns
    power = np.concatenate([design.values(k, candidate.places) @ weights for k in range(len(columns.segments))])
    size = np.abs(power)
    if candidate.id and library()[candidate.id].acts_on == "clock":
        question = {part.segment for part in columns.parts if part.in_question}
        steepest = max(float(np.abs(slope(columns.scenes[k])).max()) for k in question)
        seconds = size.max() / max(steepest, 1e-9)
        return bool(seconds > THRESHOLDS.clock_smallest_s and _recordings_shifted(design, finding))
    acting = power[size > THRESHOLDS.acting_share * size.max()]
    short = not shows_drift(design) and _is_level(design, finding)
    share = THRESHOLDS.level_share_of_range if short else THRESHOLDS.least_share_of_range
    return bool(np.sqrt(np.mean(acting**2)) > share * columns.dynamic_range)


def shows_drift(design: Design) -> bool:
    """Whether the reference shows how standby power drifts, and what the model gets wrong in other motions.

    A few minutes do not. Without a reference, nothing has drifted since.
    """
    starts = [part.start_s for part in design.parts if not part.in_question]
    return not starts or max(starts) - min(starts) >= THRESHOLDS.level_span_s


def _is_level(design: Design, finding: Finding) -> bool:
    """Whether a finding hardly changes within the blocks in question: a constant load, a gain at rest."""
    weights = finding.candidate.weights(finding.coefficients)
    blocks = [
        design.values(part.segment, finding.candidate.places, part.own) @ weights
        for part in design.parts
        if part.in_question
    ]
    steady = sum(len(block) * float(block.mean()) ** 2 for block in blocks)
    return steady > THRESHOLDS.level_steady * sum(float(block @ block) for block in blocks)


def _recordings_shifted(design: Design, finding: Finding) -> bool:
    """Whether shifts of whole recordings agree; a slope also explains motion that is sharper than logged."""
    columns, candidate = design.columns, finding.candidate
    weights = candidate.weights(finding.coefficients)
    pairs = []
    for k in sorted({part.segment for part in columns.parts if part.in_question}):
        delay = single_delay(columns.scenes[k], columns.segments[k].P)
        if delay is not None:
            steepness = slope(columns.scenes[k])
            power = design.values(k, candidate.places) @ weights
            said = -float(power @ steepness) / max(float(steepness @ steepness), 1e-12)
            pairs.append((delay, said))
    if not pairs:
        return False
    delays, shifts = np.array(pairs).T
    tolerance = THRESHOLDS.clock_agreement * float(np.median(np.abs(shifts)))
    return abs(float(np.median(delays - shifts))) < tolerance
