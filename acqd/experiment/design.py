"""The next recording: a program of pieces that decides between the causes that a report leaves open (ADR 49)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.cut import SHORTEST_S
from acqd.discrepancy.regression.least_squares import Moments
from acqd.discrepancy.regression.setup import Setup
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.errors import UserError
from acqd.experiment.choice import Worth, after, chosen, d_optimal, dealt, filled
from acqd.experiment.compared import require_known
from acqd.experiment.contest import Cause, Contest
from acqd.experiment.pieces import Piece, motion_of, pieces_of
from acqd.experiment.planned import planned
from acqd.experiment.question import Question, opened, question_of, recorded
from acqd.experiment.space import Space
from acqd.models.effects import library
from acqd.motion.controller import Motion, Step
from acqd.robot.arm import Arm
from acqd.robot.scene import load_scene

WARM_S = 7200.0
"""Work before a warm session: longer than gears take to warm up."""
_WORTH_IT, _SURE = 0.05, 0.95
"""Gain of probability below which a recording is not worth its time; probability that needs no recording."""
_COLD_S = 60.0
"""Age of a cold session in the middle of a short program."""
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Asked:
    """What the engineer asked for."""

    minutes: float = 3.0
    workspace: tuple[float, ...] | None = None
    """x, y, z from, x, y, z to, m, of the flange."""
    scene: str = "free"
    share_of_speed: float = 0.5
    causes: tuple[str, ...] = ()
    """Ids of the causes to compare; empty: what the report leaves open."""
    seed: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Outlook:
    """What a motion of the same length promises, per cause."""

    named: Floats
    """[causes] probability that the loop names the cause where that is what has changed."""
    closest: list[str]
    """[causes] what is said most easily in its place."""
    pieces: tuple[Piece, ...]
    """Of the motion, in their order; none for the recordings so far."""

    def right(self, causes: tuple[Cause, ...]) -> float:
        """Probability of the right name, over the causes by what they are believed."""
        return float(np.array([cause.believed for cause in causes]) @ self.named)


@dataclass(frozen=True, slots=True, eq=False)
class Designed:
    """A program, and what it promises."""

    question: Question
    asked: Asked
    space: Space
    cold: bool
    """Whether the session has to begin with cold gears."""
    causes: tuple[Cause, ...]
    steps: tuple[Step, ...]
    motion: Motion
    so_far: Outlook
    after: Outlook
    random: Outlook
    """After random motion of the thesis' kind of the same length."""
    for_parameters: Outlook
    """After a D-optimal motion for the model's parameters of the same length, from the same pieces."""

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """Of the program."""
        return self.after.pieces

    @property
    def worked_min(self) -> float:
        """Minutes of work before the session: 0 for cold gears."""
        return 0.0 if self.cold else WARM_S / 60

    @property
    def cut_s(self) -> float:
        """Length of the recordings that the program is cut into: the loop holds one of so many out."""
        return max(self.motion.seconds / THRESHOLDS.held_out_every, SHORTEST_S)

    @property
    def answered(self) -> bool:
        """Whether what has changed has a name that is not in doubt, and nobody asks for other causes."""
        return bool(self.question.named) and not self.question.open and not self.asked.causes

    @property
    def needed(self) -> bool:
        """Whether the recordings so far leave a question: by what the loop has said, or by what they can tell."""
        return not self.answered and (self.question.open or self.so_far.right(self.causes) < _SURE)

    @property
    def unexpected(self) -> bool:
        """Whether the loop has left open what the recordings so far should have told."""
        return self.question.open and self.so_far.right(self.causes) >= _SURE

    @property
    def decides(self) -> bool:
        """Whether the recording is worth its time; one that decides nothing may raise new doubts."""
        now, after = self.so_far.right(self.causes), self.after.right(self.causes)
        return self.needed and (after >= _SURE or after - now >= _WORTH_IT)


def next_motion(report: Path, asked: Asked, progress: Progress) -> Designed:
    """Design the recording that decides. Raises UserError, InputError."""
    require_known(asked.causes)
    question = question_of(report, asked.causes, progress)
    subject = question.subject
    space = Space.of(
        Arm(subject.robot), load_scene(asked.scene), [*subject.reference, *subject.fit], subject.data.step_s,
        asked.share_of_speed, asked.workspace,
    )  # fmt: skip
    progress("planning pieces of motion", 0.0)
    pieces = {piece.name: piece for piece in pieces_of(space, asked.seed, 60 * asked.minutes)}
    if not pieces:
        raise UserError(
            f"{subject.robot.name}: no motion of {asked.minutes:g} min keeps limits, workspace and obstacles; "
            "allow a larger workspace, more speed or more minutes"
        )
    so_far = recorded(question, progress)
    sessions = [_session(question, so_far, space, pieces, asked, progress, cold=False)]
    known = library()
    ids = [cause.candidate.id for cause in sessions[0].contest.causes]
    if any(name in known and known[name].follows_clock for name in ids):
        sessions.append(_session(question, so_far, space, pieces, asked, progress, cold=True))
    best = max(sessions, key=lambda session: session.worth)
    if not best.program:
        causes = ", ".join(cause.candidate.id or cause.candidate.label for cause in best.contest.causes)
        raise UserError(f"no motion within these limits helps to tell {causes} apart: allow more, or name other causes")
    seconds = {name: pieces[name].seconds for name in best.moments}
    total_s = sum(seconds[name] for name in best.program)
    random = filled([name for name, piece in pieces.items() if piece.random], seconds, total_s)
    steps = tuple(step for name in best.program for step in pieces[name].steps)
    motion = motion_of(space, steps)
    broken = space.broken_limit(motion)
    if broken is not None:
        raise UserError(f"the program exceeds a limit of {subject.robot.name} ({broken}): choose another --seed")
    progress("comparing with random motion", 0.9)
    parameters = best.chosen_by(d_optimal(best.contest), total_s)
    return Designed(
        question, asked, space, best.cold, best.contest.causes, steps, motion,
        *(best.outlook(program) for program in ([], best.program, random, parameters)),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Session:
    """A session to come, with the best program for its gears."""

    cold: bool
    contest: Contest
    so_far: Moments
    pieces: Mapping[str, Piece]
    moments: Mapping[str, Moments]
    """By name of the piece."""
    program: list[str]

    @property
    def worth(self) -> float:
        """Of the program."""
        return self.contest.score(self._after(self.program))

    def chosen_by(self, worth: Worth, total_s: float) -> list[str]:
        """Names of the pieces of a program that is worth most, in their order."""
        seconds = {name: self.pieces[name].seconds for name in self.moments}
        program = chosen(worth, self.so_far, self.moments, seconds, total_s, self.contest.learning_rate)
        return dealt(program, seconds, THRESHOLDS.held_out_every)

    def outlook(self, program: list[str]) -> Outlook:
        """What the recordings so far and a program promise."""
        contest, moments = replace(self.contest, another=bool(program)), self._after(program)
        pieces = tuple(self.pieces[name] for name in program)
        return Outlook(contest.probabilities(moments), contest.closest(moments), pieces)

    def _after(self, program: list[str]) -> Moments:
        return after(self.so_far, self.moments, program, self.contest.learning_rate)


def _session(
    question: Question, recordings: Setup, space: Space, pieces: Mapping[str, Piece], asked: Asked, progress: Progress,
    *, cold: bool,
) -> _Session:  # fmt: skip
    age_s = _COLD_S if cold else WARM_S
    subject = question.subject
    model = subject.model
    to_come = planned(space, list(pieces.values()), model, subject.reference, age_s)
    open_ = opened(question, recordings, to_come, asked.causes, progress)
    contest = replace(open_.contest, another=True)
    so_far = open_.moments_of(open_.so_far)
    moments = {name: open_.moments_of(weights) for name, weights in open_.pieces.items()}
    progress("choosing pieces of motion", 0.5)
    session = _Session(cold, contest, so_far, pieces, moments, [])
    return replace(session, program=session.chosen_by(contest.score, 60 * asked.minutes))


def as_json(designed: Designed) -> dict[str, Any]:
    """For next.json and `--json`."""
    outlooks = {
        "now": designed.so_far, "designed": designed.after, "random": designed.random,
        "d_optimal": designed.for_parameters,
    }  # fmt: skip
    causes = []
    for number, cause in enumerate(designed.causes):
        causes.append(
            {
                "id": cause.candidate.id, "where": cause.candidate.label, "evidence": cause.evidence,
                "believed": cause.believed,
                "named_if_true": {name: float(each.named[number]) for name, each in outlooks.items()},
                "closest": {name: each.closest[number] for name, each in outlooks.items()},
            }
        )  # fmt: skip
    return {
        "report": str(designed.question.report),
        "robot": designed.question.subject.robot.name,
        "seconds": designed.motion.seconds,
        "begins": "cold" if designed.cold else "warm",
        "worked_min": designed.worked_min,
        "cut_s": round(designed.cut_s, 1),
        "needed": designed.needed,
        "decides": designed.decides,
        "right_name": {name: each.right(designed.causes) for name, each in outlooks.items()},
        "causes": causes,
        "pieces": [{"name": piece.name, "seconds": piece.seconds} for piece in designed.pieces],
    }
