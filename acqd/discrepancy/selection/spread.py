"""What unchanged sessions of the reference differ by: how far rows can be trusted, and what is more than a difference.

Rows and blocks of a session share its errors: standby power, temperatures and the meter's gain drift over many minutes,
and the base model is wrong in another way in another motion. Then blocks agree without an effect. Two quantities are
estimated, each with a prior that counts as a few sessions, so that few sessions are not none:

- The learning rate of rows (Gruenwald 2012): the inverse of the mean square of z that any effect has in one session of
  the reference, by a base model that knows the other sessions.
- tau, the deviation of a finding's size between sessions: the random effects of a meta-analysis, every session a study
  (DerSimonian and Laird 1986). How improbable a finding is as such a difference follows by Student's t (ADR 26).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd import student
from acqd.arrays import Floats
from acqd.dataset.split import log_name
from acqd.discrepancy.regression.design_columns import Part
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import LEAST_POWER, Regression
from acqd.discrepancy.selection.ranking import Finding, acts, part_of
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.models.effects.clocks import slope
from acqd.models.segments import Segment


@dataclass(frozen=True, slots=True)
class More:
    """Times the recordings that there are, for what more of them would tell."""

    days: float = 1.0
    """Of the recordings in question."""
    reference: float = 1.0
    """Unchanged sessions to compare with."""


AS_IT_IS = More()


def learning_rate(design: Design, regression: Regression) -> float:
    """Share of a likelihood that can be believed, at most 1; the usual one without a reference."""
    weight, found = THRESHOLDS.few_sessions, surprises(design, regression)
    return (weight + len(found)) / (weight * THRESHOLDS.usual_surprise + sum(found))


def surprises(design: Design, regression: Regression) -> list[float]:
    """Mean square of z of all effects with one parameter, at least 1, for each session of the reference."""
    effects = library()
    columns = [
        candidate.indices for candidate in design.columns.candidates
        if candidate.id and candidate.size == 1 and effects[candidate.id].acts_on != "clock"
    ]  # fmt: skip
    found: list[float] = []
    if columns:
        used = np.unique(np.concatenate(columns))
        for blocks in sessions_of(design.parts, in_question=False).values():
            competition = regression.compete(used, _gate(design, blocks), 1 - design.columns.in_question)
            information = np.diag(competition.schur)
            known = information > LEAST_POWER
            if known.any():
                z_squared = competition.products[known] ** 2 / information[known]
                found.append(max(float(z_squared.mean()), 1.0))
    return found


def beyond_sessions(design: Design, regression: Regression, finding: Finding, gate: Floats) -> float:
    """How improbable a finding is as a difference of unchanged sessions; infinite without a reference.

    -2 log P(|t| > z), on the scale of evidence: `by_chance` asks the same of the best of many kinds (Bonferroni).
    `regression`: without the finding.
    """
    if not sessions_of(design.parts, in_question=False):
        return np.inf
    variance, freedom = variances_of_sizes(design, regression, [finding], gate)[0]
    return float(-2 * (np.log(2) + student.logsf(variance**-0.5, freedom)))


def variances_of_sizes(
    design: Design, regression: Regression, findings: Sequence[Finding], gate: Floats, more: More = AS_IT_IS
) -> list[tuple[float, float]]:
    """Variances of findings' sizes where nothing has changed, in squared units of the finding, and their freedom.

    Where torques say something, of the mean of what power and torques say, weighted by the inverse of their variances:
    unchanged sessions differ in both, independently, and often less in torques.
    """
    of_power = variances_of_sessions(design, regression, findings, gate, more)
    return [
        (_of_both(design, finding, variance, gate, more), freedom)
        for finding, (variance, freedom) in zip(findings, of_power, strict=True)
    ]


def _of_both(design: Design, finding: Finding, in_power: float, gate: Floats, more: More) -> float:
    """Variance of the weighted mean, in squared units of the mean; infinite where that has another sign.

    What both differ by beyond a 95 % interval counts as a variance between witnesses (DerSimonian and Laird 1986).
    """
    both = finding.witnesses
    seen = None if both is None else design.differences_at_joints(finding.candidate, gate, finding.coefficients)
    if both is None or seen is None:
        return in_power
    in_torques = variance_of(design, seen.sizes, seen.information, seen.usual, gate, more)
    of_power, of_torques = 1 / both.power + in_power, 1 / both.torques + in_torques
    usual = THRESHOLDS.interval_width**2 * (of_power + of_torques)
    between = max((both.power_says - both.torques_say) ** 2 - usual, 0.0) / 2
    power, torques = 1 / (of_power + between), 1 / (of_torques + between)
    variance = (power**2 * (in_power + between) + torques**2 * (in_torques + between)) / (power + torques) ** 2
    size = (power * both.power_says + torques * both.torques_say) / (power + torques)
    return variance / size**2 if size > 0 else np.inf


def variance_of_sessions(design: Design, regression: Regression, finding: Finding, gate: Floats) -> tuple[float, float]:
    """Variance of a finding's size in power where nothing has changed, in squared units of the finding; its freedom.

    Of the mean of the sessions under `gate` [blocks] about that of the reference's sessions, and between
    days, which differ as much as the sessions of a day; recordings that were added from another session are of another
    day. A log is as many sessions as it is longer than those of the reference: what differs between these averages out
    in an hour.
    """
    return variances_of_sessions(design, regression, [finding], gate)[0]


def variances_of_sessions(
    design: Design, regression: Regression, findings: Sequence[Finding], gate: Floats, more: More = AS_IT_IS
) -> list[tuple[float, float]]:
    """The same of several findings, whose columns are projected once a session."""
    by_clock_W = _usual_by_clock(design) if any(map(_of_the_clock, findings)) else 0.0
    return [
        (
            variance_of(design, amplitudes, information, _usual_amplitude(design, finding, by_clock_W), gate, more),
            THRESHOLDS.few_sessions + more.reference * len(amplitudes),
        )
        for finding, (amplitudes, information) in zip(findings, _amplitudes(design, regression, findings), strict=True)
    ]


def variance_of(
    design: Design, amplitudes: Floats, information: Floats, usual: float, gate: Floats, more: More = AS_IT_IS
) -> float:
    """The variance by sizes in single sessions of the reference [sessions] and their information [sessions]."""
    weight, known = THRESHOLDS.few_sessions, more.reference * len(amplitudes)
    excess = max(float(information @ amplitudes**2) - len(amplitudes), 0.0)
    measured = excess / information.sum() if len(amplitudes) else 0.0
    variance = (weight * usual**2 + known * measured) / (weight + known)
    before = len(sessions_of(design.parts, in_question=False))
    rows, in_question = design.blocks.rows, design.columns.in_question
    as_long = float(rows @ (gate * in_question)) / (float(rows @ (1 - in_question)) / before)
    open_ = [part for part, acting in zip(design.parts, gate, strict=True) if acting]
    logs = len(sessions_of(open_, in_question=True))
    days = len({design.columns.segments[part.segment].session for part in open_ if part.in_question})
    return variance * (1 / (more.reference * before) + 1 / max(logs, as_long, 1.0) + 1 / (more.days * max(days, 1)))


def _amplitudes(design: Design, regression: Regression, findings: Sequence[Finding]) -> list[tuple[Floats, Floats]]:
    """Per finding [sessions] its size in single sessions of the reference, in units of itself, and their information.

    By generalised least squares in one session, with a base model that knows the reference only. The information is
    the inverse variance of an amplitude in white noise.
    """
    used = np.unique(np.concatenate([finding.candidate.indices for finding in findings]))
    positions = [np.searchsorted(used, finding.candidate.indices) for finding in findings]
    pairs: list[list[tuple[float, float]]] = [[] for _ in findings]
    for blocks in sessions_of(design.parts, in_question=False).values():
        competition = regression.compete(used, _gate(design, blocks), 1 - design.columns.in_question)
        for finding, own, found in zip(findings, positions, pairs, strict=True):
            schur, products = part_of(competition.schur, competition.products, own, finding.candidate)
            known = float(finding.coefficients @ schur @ finding.coefficients)
            if acts(schur) and known > LEAST_POWER:
                found.append((float(finding.coefficients @ products) / known, known))
    values = [np.array(each).reshape(-1, 2) for each in pairs]
    return [(each[:, 0], each[:, 1]) for each in values]


def _usual_amplitude(design: Design, finding: Finding, by_clock_W: float) -> float:
    """Deviation between sessions that is usual, in units of the finding: a share of the range, or that of clocks."""
    if _of_the_clock(finding):
        return by_clock_W / max(power_rms(design, finding, acting_share=0.0), 1e-9)
    return THRESHOLDS.usual_difference * design.columns.dynamic_range / max(power_rms(design, finding), 1e-9)


def _of_the_clock(finding: Finding) -> bool:
    return bool(finding.candidate.id) and library()[finding.candidate.id].acts_on == "clock"


def _usual_by_clock(design: Design) -> float:
    """W RMS: power that is drawn at other times by the shift between motion and power that two alignments differ by."""
    slopes = [slope(design.columns.scenes[k]) for k, side in enumerate(design.columns.scenes.in_question) if side]
    return clock_deviation_s(design) * float(np.sqrt(np.mean(np.concatenate(slopes) ** 2)))


def clock_deviation_s(design: Design) -> float:
    """Standard deviation of the shift between motion and power that two alignments differ by, s.

    What the datasets say of their lags on both sides, and what an alignment gets wrong besides.
    """
    sides = [
        np.mean([(s.lag_within_s / THRESHOLDS.interval_width) ** 2 for s in _side(design, in_question=side)])
        for side in (True, False)
    ]
    return float(np.sqrt(2 * THRESHOLDS.delay_floor_s**2 + sum(sides)))


def _side(design: Design, *, in_question: bool) -> list[Segment]:
    columns = design.columns
    pairs = zip(columns.segments, columns.scenes.in_question, strict=True)
    return [segment for segment, side in pairs if side == in_question]


def power_rms(design: Design, finding: Finding, acting_share: float = THRESHOLDS.acting_share) -> float:
    """W RMS of a finding while it acts, in the recordings in question."""
    weights = finding.candidate.weights(finding.coefficients)
    power = np.concatenate(
        [design.values(p.segment, finding.candidate.indices, p.own) @ weights for p in design.parts if p.in_question]
    )
    size = np.abs(power)
    acting = power[size >= acting_share * size.max()]
    return float(np.sqrt(np.mean(acting**2)))


def sessions_of(parts: list[Part] | tuple[Part, ...], *, in_question: bool) -> dict[str, NDArray[np.int64]]:
    """Blocks of one side by log."""
    sessions: dict[str, list[int]] = {}
    for number, part in enumerate(parts):
        if part.in_question == in_question:
            sessions.setdefault(log_name(part.recording), []).append(number)
    return {name: np.array(blocks) for name, blocks in sessions.items()}


def logs_in_question(design: Design) -> dict[str, Floats]:
    """[blocks] gate of every log in question."""
    return {name: _gate(design, blocks) for name, blocks in sessions_of(design.parts, in_question=True).items()}


def _gate(design: Design, blocks: NDArray[np.int64]) -> Floats:
    gate = np.zeros(len(design.parts))
    gate[blocks] = 1.0
    return gate
