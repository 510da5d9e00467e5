"""What a report leaves open: the recordings so far, and the causes that the next recording has to decide between."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.discrepancy.another_time import another_time
from acqd.discrepancy.averaging import with_like_means
from acqd.discrepancy.beforehand import PLANNED
from acqd.discrepancy.causes.belief import Belief
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.recordings import Subject, subject_of
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Column, Moments, Regression
from acqd.discrepancy.regression.row_noise import new_power, usual_noise
from acqd.discrepancy.regression.setup import Comparison, Setup, set_up
from acqd.discrepancy.regression.white_rows import white_products
from acqd.discrepancy.search import unexplained
from acqd.discrepancy.selection.judging import best_of_each, kinds_of
from acqd.discrepancy.selection.ranking import Rows, prior_of, ranked
from acqd.discrepancy.selection.session_columns import CLOCK, LEVEL, with_sessions
from acqd.discrepancy.settled import leaves_open, settled
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.errors import InputError, UserError
from acqd.experiment.compared import causes_of, leading_causes
from acqd.experiment.contest import Cause, Contest
from acqd.models.effects import library, unmoved
from acqd.models.segments import Segment

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
    subject, what = question.subject, "computing the columns of the recordings"
    return _set_up(subject, subject.fit, subject.begins, progress, what)


def opened(
    question: Question, so_far: Setup, planned: list[Segment], asked: tuple[str, ...], progress: Progress
) -> Open:
    """The design of all recordings, with planned pieces of motion.

    What is believed, and how far rows can be trusted, follows from the recordings that exist; the pieces only add
    columns. `asked`: ids of the causes to compare; empty: those that the loop cannot yet choose between. Raises
    UserError.
    """
    subject = question.subject
    known = with_sessions(so_far)
    whole = _set_up(
        subject, [*subject.fit, *planned], subject.begins, progress, "computing the columns of pieces of motion"
    )
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
    found = ranked(
        known, known.design.columns.in_question, [c for c in known.design.columns.candidates if c.id not in out]
    )
    candidates = [each for each in rows.design.columns.candidates if each.id not in out]
    causes = causes_of(
        known,
        rows,
        exists,
        leading_causes(best_of_each(found), known, asked, question.believed),
        question.believed,
        asked=bool(asked),
    )
    evidence = {each.candidate.key: each.evidence for each in found}
    return Open(rows, exists, pieces, _contest(rows, exists, causes, candidates, evidence))


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
    """Effects that have a name are free columns, in logged torques, too.

    One that was detected in the residual has no column beforehand.
    """
    for name, where in named:
        own = [each for each in rows.design.columns.candidates if (each.id, each.label) == (name, where)]
        findings = ranked(rows, gate, own)
        if findings:
            best = findings[0].candidate
            columns = [Column(int(index), gate, owner=best.key) for index in best.indices]
            rows = replace(rows, regression=rows.regression.with_columns(rows.design.blocks, columns))
            witness, variant = rows.design.witness, best.fitted or best.variant
            if witness is not None and variant is not None and witness.sees(name):
                rows = rows.on(replace(rows.design, witness=witness.given(name, variant)))
    return rows


def _contest(
    rows: Rows, so_far: Floats, causes: tuple[Cause, ...], candidates: list[Candidate], evidence: dict[str, float]
) -> Contest:
    """With the closest rivals of every kind, by the recordings so far and by all pieces together.

    `evidence` of hypotheses in the recordings so far, by key.
    """
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
    compared = _compared(rows, causes, [candidates[number] for number in sorted(keep)], kinds)
    return compared.since(without_intercepts(rows.regression, compared, gate, so_far), evidence)


def _compared(rows: Rows, causes: tuple[Cause, ...], rivals: list[Candidate], kinds: int) -> Contest:
    own = np.array([not column.block_intercept for column in rows.regression.columns])
    priors = [prior_of(rows.design, rival) for rival in rivals]
    in_question = {part.recording for part in rows.design.parts if part.in_question}
    recordings = sum(not name.startswith(PLANNED) for name in in_question)
    return Contest.of(causes, rivals, priors, rows.regression.precision[own], rows.learning_rate, kinds, recordings)
