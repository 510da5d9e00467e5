"""What less would have been: one change at a time and the best of all, at equal cycle time and at a longer one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from acqd.errors import UserError
from acqd.motion.controller import Motion
from acqd.saving.cycle import Rest, Stretch, joined, pieces_of
from acqd.saving.plan import Change, Cycle
from acqd.saving.power import Use
from acqd.saving.source import Asked, Subject
from acqd.saving.time_law import Bounds

Verdict = Literal["saves", "unprovable", "uses more", "no interval"]
Progress = Callable[[str, float], None]
_NOTHING_J = 0.05
"""A saving that rounds to nothing."""
_PARETO = (0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.35, 1.5)
"""Cycle times of the picture, as shares of the old one."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A motion that does the same work."""

    name: str
    motion: Motion
    use: Use
    saving: float
    """J a cycle."""
    half: float | None
    """Half the width of its 90 % interval, J; None without held-out recordings."""

    @property
    def verdict(self) -> Verdict:
        """Whether the saving is beyond the model's error."""
        if self.half is None:
            return "no interval"
        if abs(self.saving) <= self.half:
            return "unprovable"
        return "saves" if self.saving > 0 else "uses more"


@dataclass(frozen=True, slots=True)
class Refused:
    """A proposal that was not made."""

    name: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Pareto:
    """Energy against cycle time."""

    seconds: list[float]
    best: list[float]
    """J."""
    uniform: list[float]
    """J, of plain uniform slowing; NaN where it would be faster than the limits allow."""


@dataclass(frozen=True, slots=True, eq=False)
class Savings:
    """All proposals."""

    subject: Subject
    asked: Asked
    before: Use
    equal: list[Proposal]
    """At equal cycle time; the last one is the best of all together."""
    longer: list[Proposal]
    """At the longer cycle time, likewise."""
    refused: list[Refused]
    pareto: Pareto
    unknown: list[str]
    """What the model cannot tell."""

    @property
    def best(self) -> Proposal | None:
        """The best together at equal cycle time, or at the longer one where that saves and the other does not."""
        for proposals in (self.equal, self.longer):
            if proposals and proposals[-1].verdict in ("saves", "no interval") and proposals[-1].saving > 0:
                return proposals[-1]
        return None


def savings(subject: Subject, asked: Asked, progress: Progress) -> Savings:
    """Make all proposals. Raises UserError."""
    pieces = pieces_of(subject.motion)
    if not any(isinstance(piece, Stretch) for piece in pieces):
        raise UserError(f"{subject.path}: the arm does not move: there is nothing to save by another motion")
    if not any(isinstance(piece, Stretch) and not piece.fixed for piece in pieces):
        raise UserError(f"{subject.path}: begins and ends in motion without a pause: record a whole cycle")
    limits = subject.limits
    robot = subject.arm.description
    assert limits.jerk is not None
    bounds = Bounds(robot, limits.speed, limits.acceleration, limits.jerk)
    progress("timing the stretches", 0.1)
    cycle = Cycle.of(pieces, bounds, subject.meter, asked.least_rest)
    maker = _Maker(subject, cycle)
    brakes = asked.brakes_after if subject.meter.knows_brakes else None
    waits = not asked.keep_waits and any(isinstance(piece, Rest) and cycle.slack(piece) for piece in pieces)
    equal_s = cycle.seconds
    longer_s = asked.seconds if asked.seconds is not None else (1 + asked.longer) * equal_s
    equal: dict[str, Change] = {"timing along the path": Change(laws=True)}
    if waits:
        equal["plain slowing into the waits"] = Change(slower=True, waits=True)
        equal["waits used for motion"] = Change(laws=True, waits=True)
    closing = brakes is not None and any(
        isinstance(piece, Rest) and not piece.outer and piece.seconds > brakes for piece in pieces
    )
    if closing:
        equal[f"brakes close after {brakes:g} s"] = Change(brakes_after=brakes)
    longer = {
        "plain uniform slowing": Change(slower=True, waits=waits),
        "timing along the path": Change(laws=True),
    }
    if waits:
        longer["waits used for motion"] = Change(laws=True, waits=True)
    progress("judging proposals", 0.7)
    made = [maker.proposal(name, change, equal_s) for name, change in equal.items()]
    options = [
        Change(laws=True, waits=w, brakes_after=b) for w in {False, waits} for b in {None, brakes if closing else None}
    ]
    made.append(maker.best_of(options, equal_s))
    made_longer = [maker.proposal(name, change, longer_s) for name, change in longer.items()]
    made_longer.append(maker.best_of(options, longer_s))
    progress("energy against cycle time", 0.85)
    return Savings(
        subject, asked, maker.before, [each for each in made if each], [each for each in made_longer if each],
        maker.refused, maker.pareto(options, waits=waits), _unknown(subject),
    )  # fmt: skip


class _Maker:
    """Makes proposals of one cycle, and keeps what was refused."""

    def __init__(self, subject: Subject, cycle: Cycle) -> None:
        self.subject, self.cycle = subject, cycle
        self.before = subject.meter.use(joined([subject.motion]))
        self.refused: list[Refused] = []

    def proposal(self, name: str, change: Change, total_s: float) -> Proposal | None:
        """None, and a reason among the refused, where a limit would be broken."""
        try:
            made = self._made(name, change, total_s)
        except UserError as error:
            self.refused.append(Refused(name, str(error)))
            return None
        broken = self.subject.limits.broken(made.motion)
        if broken is not None:
            self.refused.append(Refused(name, f"would break a limit: {broken}"))
            return None
        return made

    def best_of(self, changes: list[Change], total_s: float) -> Proposal | None:
        """The change that saves most."""
        made = [each for change in changes if (each := self.proposal("best together", change, total_s))]
        return max(made, key=lambda each: each.saving, default=None)

    def _made(self, name: str, change: Change, total_s: float) -> Proposal:
        durations = self.cycle.durations(change, total_s)
        motion = self.cycle.motion(change, durations)
        use = self.subject.meter.use(motion)
        doubt = self.subject.doubt
        changed = self.cycle.changed_s(change, durations)
        half = None if doubt is None else doubt.half_width(self.before, use, changed)
        return Proposal(name, motion, use, self.before.energy - use.energy, half)

    def pareto(self, options: list[Change], *, waits: bool) -> Pareto:
        """Energy against cycle time, of the best change and of plain uniform slowing."""
        pareto = Pareto([], [], [])
        for share in _PARETO:
            seconds = share * self.cycle.seconds
            try:
                best = min(self._made("", change, seconds).use.energy for change in options)
            except UserError:
                continue
            uniform = np.nan
            if share >= 1.0:
                uniform = self._made("", Change(slower=True, waits=waits and share > 1.0), seconds).use.energy
            pareto.seconds.append(seconds)
            pareto.best.append(best)
            pareto.uniform.append(float(uniform))
        return pareto


def _unknown(subject: Subject) -> list[str]:
    """What the model cannot tell, in sentences."""
    said = []
    if not subject.meter.knows_brakes:
        said.append(
            "brakes: the model has learned from logs without a brake signal, so that closed brakes mean nothing to it"
        )
    if "thermal_friction" not in subject.meter:
        said.append("warm-up: the model has no friction of cold gears; it predicts warm gears only")
    return said
