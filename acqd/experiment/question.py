"""What a report leaves open: the recordings so far, and the causes that the next recording has to decide between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.discrepancy.another_time import another_time
from acqd.discrepancy.averaging import with_like_means
from acqd.discrepancy.beforehand import PLANNED
from acqd.discrepancy.causes.belief import OUTSIDE, Belief, shipped
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.recordings import Subject, subject_of
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Column, Moments, Regression
from acqd.discrepancy.regression.row_noise import new_power, usual_noise
from acqd.discrepancy.regression.setup import Comparison, Setup, set_up
from acqd.discrepancy.regression.white_rows import white_products
from acqd.discrepancy.search import begins_of, unexplained
from acqd.discrepancy.selection.judging import best_of_each, kinds_of
from acqd.discrepancy.selection.ranking import Finding, Rows, bounds_of, part_of, prior_of, ranked
from acqd.discrepancy.selection.session_columns import CLOCK, LEVEL, with_sessions
from acqd.discrepancy.selection.spread import More, variances_of_sessions
from acqd.discrepancy.settled import leaves_open, settled
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance
from acqd.errors import InputError, UserError
from acqd.experiment.contest import Cause, Contest
from acqd.models.effects import library, unmoved
from acqd.models.segments import Segment

CAUSES = 6
"""That are compared at most."""
_FEWEST = 3
"""Where one leads."""
_RIVALS = 3
"""Of every kind, the closest places and shapes, by the recordings so far and by all pieces of motion."""
_SESSIONS = (LEVEL, CLOCK)
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Question:
    """A run of the loop, as its report remembers it."""

    report: Path
    config: CloseConfig
    subject: Subject
    """Without the power that the model knows, and without a delay that was corrected."""
    named: tuple[tuple[str, str], ...]
    """Ids and places of the effects that the report has named and does not doubt."""
    open: bool
    """Whether the report leaves a question: no name for what differs, or a name in doubt."""
    believed: Belief | None
    """Of the largest cause; None where that one has its name already, and where the report has no set of causes."""


@dataclass(frozen=True, slots=True, eq=False)
class Open:
    """The recordings so far beside pieces of motion to come, and the causes that are compared."""

    rows: Rows
    so_far: Floats
    """[blocks] 1 for recordings that exist."""
    pieces: dict[str, Floats]
    """Name of a piece -> [blocks] share of its blocks that the loop fits to: the others are held out."""
    contest: Contest

    def moments_of(self, weights: Floats) -> Moments:
        """What some blocks say; their random intercepts are projected out."""
        gate = self.rows.design.columns.in_question
        return without_intercepts(self.rows.regression, self.contest, gate, weights)


def question_of(report: Path, asked: tuple[str, ...], progress: Progress) -> Question:
    """Open the folder of a closing report; `asked`: ids of the causes to compare. Raises UserError, InputError."""
    file = report / "report.json"
    try:
        told = orjson.loads(file.read_bytes())
        config = CloseConfig.from_json(told["asked"], report)
        named = tuple((str(each["id"]), str(each["where"])) for each in told["effects"] if settled(each))
        doubted = [
            (str(each["id"]), *(str(member["id"]) for member in each["family"]["members"]))
            for each in told["effects"]
            if not settled(each)
        ]
        unanswered, all_named = leaves_open(told), told["verdict"] == "effects_found"
        said = told.get("causes")
        believed = Belief(said["probabilities"], tuple(said["set"])) if said and not named else None
    except OSError as error:
        raise UserError(
            f"{file} cannot be read ({error.strerror}); name the folder that acqd close-loop has written"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise InputError(file, "is no report of acqd close-loop, or an older one; run acqd close-loop again") from None
    if all_named and not asked:
        _require_motion_helps(report, doubted)
    whole = subject_of(config, progress)
    if mistimed := another_time(whole):
        raise UserError(f"{config.dataset}: {mistimed}")
    subject, _ = with_like_means(whole)
    if not subject.reference:
        raise UserError(
            f"{report}: the loop had no reference to compare with; close the loop on later recordings first"
        )
    return Question(report, config, unexplained(subject)[1], named, unanswered, believed)


def _require_motion_helps(report: Path, doubted: list[tuple[str, ...]]) -> None:
    """Raises UserError where every doubt is between effects that no motion tells apart."""
    if doubted and all(map(unmoved, doubted)):
        raise UserError(
            f"{report} leaves open: {' or '.join(doubted[0])}. Such equipment switches at times of its own, so that no "
            f"motion of the arm decides; what decides: {library()[doubted[0][0]].experiment}"
        )


def recorded(question: Question, progress: Progress) -> Setup:
    """The design of the recordings so far, which all sessions to come share."""
    begins = begins_of([*question.subject.fit, *question.subject.held_out])
    return _set_up(question.subject, question.subject.fit, begins, progress, "computing the columns of the recordings")


def opened(
    question: Question, so_far: Setup, planned: list[Segment], asked: tuple[str, ...], progress: Progress
) -> Open:
    """The design of all recordings, with planned pieces of motion.

    What is believed, and how far rows can be trusted, follows from the recordings that exist; the pieces only add
    columns. `asked`: ids of the causes to compare; empty: those that the loop cannot yet choose between. Raises
    UserError.
    """
    subject = question.subject
    begins = begins_of([*subject.fit, *subject.held_out])
    known = with_sessions(so_far)
    whole = _set_up(subject, [*subject.fit, *planned], begins, progress, "computing the columns of pieces of motion")
    rows = _trusted_as(known, _with_design(whole, so_far.design))
    names = [part.recording.removeprefix(PLANNED) for part in rows.design.parts[len(known.design.parts) :]]
    exists: Floats = np.concatenate([np.ones(len(known.design.parts)), np.zeros(len(names))])
    fitted = 1 - 1 / THRESHOLDS.held_out_every
    pieces = {
        name: np.concatenate([np.zeros(len(known.design.parts)), [fitted * (other == name) for other in names]])
        for name in dict.fromkeys(names)
    }
    named = tuple(each for each in question.named if each[0] not in asked)
    known = _with_named(known, known.design.columns.in_question, named)
    rows = _with_named(rows, rows.design.columns.in_question, named)
    out = {name for name, _ in named}
    findings = best_of_each(
        ranked(known, known.design.columns.in_question, [c for c in known.design.columns.candidates if c.id not in out])
    )
    candidates = [each for each in rows.design.columns.candidates if each.id not in out]
    causes = _causes(known, rows, exists, _leading(findings, known, asked, question.believed), question.believed)
    return Open(rows, exists, pieces, _contest(rows, exists, causes, candidates))


def _set_up(
    subject: Subject, in_question: list[Segment], begins: dict[str, float], progress: Progress, what: str
) -> Setup:
    return set_up(
        Comparison(
            model=subject.carrier, robot=subject.robot, in_question=in_question, reference=subject.reference,
            chosen=subject.chosen, withheld=subject.withheld, begins=begins,
        ),
        lambda share: progress(what, share),
    )  # fmt: skip


def _with_design(whole: Setup, so_far: Design) -> Setup:
    """With the noise of the recordings that exist, and the usual noise of the reference in the pieces.

    The pieces lack the change: one fit to both would take the change for noise.
    """
    known = so_far.parts
    columns, rising = whole.design.columns, so_far.columns.rising
    pieces = columns.parts[len(known) :]
    noise = [part.noise for part in known]
    noise += [usual_noise(rising, new_power(columns, so_far.whitener, part)) for part in pieces]
    parts = tuple(replace(part, noise=own) for part, own in zip(columns.parts, noise, strict=True))
    trusted = (*so_far.trusted, *whole.design.trusted[len(known) :])
    columns = replace(columns, parts=parts, rising=rising)
    products = [white_products(columns, so_far.whitener, part) for part in columns.parts]
    design = Design.of(columns, so_far.whitener, so_far.slow_whitener, trusted, products)
    if whole.design.added[0]:  # a load that switches on both sides
        design, _ = design.with_columns(whole.design.added_columns())
    return replace(whole, design=design, regression=Regression(design.blocks, whole.regression.columns))


def _trusted_as(known: Rows, whole: Setup) -> Rows:
    """With the learning rate, the level and the clock of the recordings that exist; a session to come has its own."""
    design = whole.design
    exists = np.arange(len(design.parts)) < len(known.design.parts)
    gates = [exists * design.columns.in_question, ~exists * design.columns.in_question]
    sessions = {(c.index, c.owner): c for c in known.regression.columns if c.owner in _SESSIONS}
    more = [replace(column, gate=gate) for column in sessions.values() for gate in gates]
    return Rows(design, whole.regression.with_columns(design.blocks, more), known.learning_rate)


def without_intercepts(regression: Regression, contest: Contest, gate: Floats, weights: Floats) -> Moments:
    """Moments of weighted blocks without the columns that live in one block only: these are projected out."""
    moments = regression.moments(contest.used, gate, weights)
    own = np.array([column.block_intercept for column in regression.columns])
    acting = own & (np.diag(moments.normal) > 0)
    scale = np.diag(moments.normal)[acting] + regression.precision[acting]
    to_own, to_cross = moments.normal[np.ix_(acting, ~own)], moments.cross[acting]
    return Moments(
        moments.normal[np.ix_(~own, ~own)] - to_own.T @ (to_own / scale[:, None]),
        moments.cross[~own] - to_own.T @ (to_cross / scale[:, None]),
        moments.squares - to_cross.T @ (to_cross / scale[:, None]),
    )


def _with_named(rows: Rows, gate: Floats, named: tuple[tuple[str, str], ...]) -> Rows:
    """Effects that have a name are free columns; one that was detected in the residual has no column beforehand."""
    for name, where in named:
        own = [each for each in rows.design.columns.candidates if (each.id, each.label) == (name, where)]
        findings = ranked(rows, gate, own)
        if findings:
            best = findings[0].candidate
            columns = [Column(int(index), gate, owner=best.key) for index in best.indices]
            rows = replace(rows, regression=rows.regression.with_columns(rows.design.blocks, columns))
    return rows


def require_known(names: tuple[str, ...]) -> None:
    """Raises UserError for an effect that the library does not have, and for clocks."""
    for name in names:
        if name not in library():
            raise UserError(f"--cause {name}: no such effect; the effects are {', '.join(library())}")
        if library()[name].acts_on == "clock":
            raise UserError(
                f"--cause {name}: no motion tells; another session has other clocks (acqd dataset build aligns)"
            )


def _leading(findings: list[Finding], rows: Rows, asked: tuple[str, ...], believed: Belief | None) -> list[Finding]:
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


def _label(finding: Finding) -> str:
    return finding.candidate.id or OUTSIDE


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


def _margin(evidence: float, rows: Rows) -> float:
    kinds = kinds_of(rows.design.columns.candidates)
    return by_chance(kinds) + THRESHOLDS.column_error**2 * max(evidence, 0.0)


def _causes(
    known: Rows, rows: Rows, exists: Floats, leading: list[Finding], believed: Belief | None
) -> tuple[Cause, ...]:
    """With the report's belief, or one by the calibrated scale of evidence (ADR 65).

    `known`: the recordings that exist; `rows`: those and the pieces, in which a law has other columns.
    """
    gate = known.design.columns.in_question
    evidence = np.array([finding.evidence for finding in leading])
    scale = shipped().scale
    moved = scale.chance + scale.columns * THRESHOLDS.column_error**2 * max(float(evidence.max()), 0.0)
    shares = beliefs([_label(finding) for finding in leading], evidence, moved, believed)
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
                float(finding.deviation[0]) if single else _along(known, gate, unit),
                (float(low[0]), float(high[0])) if single else (-np.inf, np.inf),
                prior_of(known.design, finding.candidate), finding.evidence, share, spread, after,
            )
        )  # fmt: skip
    return tuple(causes)


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


def _contest(rows: Rows, so_far: Floats, causes: tuple[Cause, ...], candidates: list[Candidate]) -> Contest:
    """With the closest rivals of every kind, by the recordings so far and by all pieces together."""
    kinds, gate = kinds_of(rows.design.columns.candidates), rows.design.columns.in_question
    everything = _compared(rows, causes, candidates, kinds)
    keep: set[int] = set()
    for weights in (so_far, np.ones(len(so_far))):
        moments = without_intercepts(rows.regression, everything, gate, weights)
        for shares in everything.explained(moments).T:
            taken: dict[str, int] = {}
            for number in np.argsort(-shares).tolist():
                kind = candidates[number].kind
                if shares[number] > 0 and taken.get(kind, 0) < _RIVALS:
                    taken[kind] = taken.get(kind, 0) + 1
                    keep.add(number)
    return _compared(rows, causes, [candidates[number] for number in sorted(keep)], kinds)


def _compared(rows: Rows, causes: tuple[Cause, ...], rivals: list[Candidate], kinds: int) -> Contest:
    own = np.array([not column.block_intercept for column in rows.regression.columns])
    priors = [prior_of(rows.design, rival) for rival in rivals]
    return Contest.of(causes, rivals, priors, rows.regression.precision[own], rows.learning_rate, kinds)
