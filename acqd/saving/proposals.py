"""What less would have been: one change at a time and the best of all, at equal cycle time and at a longer one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from acqd.errors import UserError
from acqd.models.effects.cause import Cause
from acqd.motion.controller import RATE, Motion
from acqd.motion.program_file import Program
from acqd.saving.cycle import RELEASE_S, Rest, Stretch, joined, pieces_of
from acqd.saving.log_cycle import LogCycle
from acqd.saving.order import reordered
from acqd.saving.plan import UNIFORM, Change, Cycle, at_rest
from acqd.saving.posture import LONG_S, easier_rests, easier_waits
from acqd.saving.power import Use
from acqd.saving.program_cycle import ProgramCycle
from acqd.saving.source import Asked, Subject
from acqd.saving.time_law import Bounds

Verdict = Literal["saves", "unprovable", "uses more", "no interval"]
Progress = Callable[[str, float], None]
TOGETHER = "best together"
_NUMERICAL = 1e-5
"""Of the energy of a cycle: what interpolation to 1 kHz and smoothing of rests change, 4e-6 in six programs."""
_LONGEST = 10.0
"""Cycle times, of the old one, that are looked at."""
_PARETO = (0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.35, 1.5)
"""Cycle times of the picture, as shares of the old one."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A motion that does the same work."""

    name: str
    motion: Motion
    program: Program | None
    """None for the motion of a log."""
    use: Use
    saving: float
    """J a cycle."""
    half: float | None
    """Half the width of its 90 % interval, J; None without held-out recordings."""
    brakes_after: float | None = None
    """s of standstill after which the brakes have to close; None: as they did."""

    @property
    def verdict(self) -> Verdict:
        """Whether the saving is beyond the model's error."""
        if self.half is None:
            return "no interval"
        if abs(self.saving) <= self.half:
            return "unprovable"
        return "saves" if self.saving > 0 else "uses more"


@dataclass(frozen=True, slots=True)
class WhatIf:
    """The motion as it is in another state of the robot."""

    name: str
    energy: float
    """J."""
    saving: float
    """J a cycle; negative where more is used."""
    half: float | None
    """Half the width of the 90 % interval of that, J."""


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
    """J, of plain uniform slowing; NaN for shorter cycles."""
    waiting: list[float]
    """J, of the motion as it is with waiting at its end; NaN for shorter cycles."""
    standby: list[float]
    """J that no motion changes, of the best."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Proposals of one cycle time."""

    seconds: float
    instead: Proposal
    """What they are compared with: the motion as it is, in a longer cycle followed by waiting."""
    proposals: list[Proposal]
    """One change at a time; the last one is the best of all together."""

    @property
    def best(self) -> Proposal | None:
        """The best together, if it is sure to save, or if nothing is known about that."""
        made = self.proposals[-1] if self.proposals else None
        return made if made and made.saving > 0 and made.verdict in ("saves", "no interval") else None


@dataclass(frozen=True, slots=True, eq=False)
class Savings:
    """All proposals."""

    subject: Subject
    asked: Asked
    equal: Block
    """At equal cycle time."""
    other: Block
    """At the cycle time that was asked for."""
    refused: list[Refused]
    pareto: Pareto
    what_ifs: list[WhatIf]
    unknown: list[str]
    """What the model cannot tell."""

    @property
    def before(self) -> Use:
        """As it is."""
        return self.equal.instead.use

    @property
    def best(self) -> tuple[Block, Proposal] | None:
        """What is worth doing: at equal cycle time, else at the other one."""
        return next(((block, best) for block in (self.equal, self.other) if (best := block.best)), None)


Option = tuple[Cycle, Change]
"""A change of a cycle, whose waits may be elsewhere than they are."""


def savings(subject: Subject, asked: Asked, progress: Progress) -> Savings:
    """Make all proposals. Raises UserError."""
    progress("timing the motions", 0.1)
    cycle = _cycle_of(subject, asked)
    easier = _easier(subject, cycle, asked)
    maker = _Maker(subject, cycle.seconds)
    brakes = asked.brakes_after if subject.meter.knows_brakes and _closes(cycle, asked.brakes_after) else None
    waits = not asked.keep_waits and any(isinstance(piece, Rest) and cycle.slack(piece) for piece in cycle.pieces)
    ordered = _ordered(subject, cycle) if asked.free_order else None
    together = [
        (where, Change(cycle.laws[-1], waits=may, brakes_after=after))
        for where in (cycle, easier, ordered)
        if where is not None
        for may in dict.fromkeys((False, waits))
        for after in dict.fromkeys((None, brakes))
    ]
    progress("judging proposals", 0.7)
    laws: dict[str, Option] = {name: (cycle, Change(name)) for name in cycle.laws}
    also: dict[str, Option] = {}
    if waits:
        also["plain slowing into the waits"] = cycle, Change(UNIFORM, waits=True)
        also["waits used for motion"] = cycle, Change(cycle.laws[-1], waits=True)
    if brakes is not None:
        also[f"brakes close after {brakes:g} s"] = cycle, Change(brakes_after=brakes)
    if easier is not None:
        also["waits at easier postures"] = easier, Change()
    if ordered is not None:
        also["another order of points"] = ordered, Change(cycle.laws[-1])
    other_s = asked.seconds if asked.seconds is not None else (1 + asked.longer) * cycle.seconds
    if other_s > _LONGEST * cycle.seconds:
        raise UserError(f"--longer: a cycle of {other_s:.0f} s is more than {_LONGEST:g} times {cycle.seconds:.1f} s")
    equal, best = maker.block(laws | also, together, cycle.seconds)
    other, _ = maker.block({"plain uniform slowing": (cycle, Change(UNIFORM))} | laws, together, other_s)
    if asked.seconds is not None and not other.proposals:
        raise UserError(f"--longer {asked.seconds:g}s: {maker.refused[-1].reason}")
    progress("energy against cycle time", 0.85)
    pareto = maker.pareto(best or together[0], (cycle, Change(UNIFORM)))
    refused = list(dict.fromkeys(maker.refused))
    return Savings(subject, asked, equal, other, refused, pareto, maker.what_ifs(asked.payload_kg), _unknown(subject))


def _cycle_of(subject: Subject, asked: Asked) -> Cycle:
    bounds = _bounds_of(subject)
    if subject.program is not None:
        return ProgramCycle(subject.program, bounds, subject.meter, asked.least_rest)
    pieces = pieces_of(subject.motion)
    if not any(isinstance(piece, Stretch) and not piece.fixed for piece in pieces):
        raise UserError(f"{subject.path}: begins and ends in motion without a pause: record a whole cycle")
    return LogCycle(pieces, bounds, subject.meter, asked.least_rest)


def _bounds_of(subject: Subject) -> Bounds:
    limits = subject.limits
    assert limits.jerk is not None
    return Bounds(subject.arm.description, limits.speed, limits.acceleration, limits.jerk)


def _easier(subject: Subject, cycle: Cycle, asked: Asked) -> Cycle | None:
    """The cycle with long waits elsewhere; None where that is of no use or not wanted."""
    if asked.keep_waits:
        return None
    meter, least_rest = subject.meter, asked.least_rest
    rests = [piece for piece in cycle.pieces if isinstance(piece, Rest)]
    moved = sum(2 * at_rest(cycle.slack(rest)) for rest in rests if cycle.slack(rest) > LONG_S)
    if isinstance(cycle, ProgramCycle) and subject.program is not None:
        program = easier_waits(subject.program, subject.arm.description, meter, least_rest)
        return None if program is None else cycle.with_program(program, moved)
    assert isinstance(cycle, LogCycle)
    parts = easier_rests(cycle.recorded, meter, _bounds_of(subject), least_rest)
    return None if parts is None else cycle.with_parts(parts, moved)


def _ordered(subject: Subject, cycle: Cycle) -> Cycle | None:
    """The cycle with its points in the best order; None where it has that."""
    assert subject.program is not None and isinstance(cycle, ProgramCycle)
    robot, checker = subject.arm.description, subject.limits.checker
    program = reordered(subject.program, robot, checker, subject.meter)
    return None if program is None else cycle.with_program(program, 2 * cycle.seconds)


def _closes(cycle: Cycle, after_s: float) -> bool:
    """Whether a pause is long enough for brakes to close and open."""
    return any(
        isinstance(piece, Rest) and not piece.outer and piece.seconds > after_s + RELEASE_S for piece in cycle.pieces
    )


class _Maker:
    """Makes proposals of one cycle, and keeps what was refused."""

    def __init__(self, subject: Subject, seconds: float) -> None:
        self.subject, self._seconds = subject, seconds
        self.refused: list[Refused] = []

    def block(
        self, options: Mapping[str, Option], together: Sequence[Option], total_s: float
    ) -> tuple[Block, Option | None]:  # fmt: skip
        """Every change by itself, and the one that saves most of those that change as much as possible."""
        instead = self._as_it_is(total_s)
        made = [self._kept(name, option, total_s, instead) for name, option in options.items()]
        best = [(each, option) for option in together if (each := self._kept(TOGETHER, option, total_s, instead))]
        proposals = [each for each in made if each]
        if not best:
            return Block(total_s, instead, proposals), None
        most, option = max(best, key=lambda pair: pair[0].saving)
        return Block(total_s, instead, [*proposals, most]), option

    def _as_it_is(self, total_s: float) -> Proposal:
        """The motion as it is, in a longer cycle followed by waiting."""
        motion, rows = self.subject.motion, max(round((total_s - self._seconds) * RATE), 0)
        ends = [values[-1:].repeat(rows) for values in (motion.brake_open, motion.tool_on)]
        waiting = Rest(motion.q[-1], rows / RATE, ends[0], ends[1], process=False, outer=True)
        whole = joined([motion, waiting.lasting(rows / RATE, None)])
        return Proposal("as it is, then waiting" if rows else "as it is", whole, None, self._use(whole), 0.0, None)

    def _kept(self, name: str, option: Option, total_s: float, instead: Proposal) -> Proposal | None:
        """None, and a reason among the refused, where a limit would be broken."""
        try:
            made = self._made(name, option, total_s, instead)
        except UserError as error:
            self.refused.append(Refused(name, str(error)))
            return None
        broken = self.subject.limits.broken(made.motion)
        if broken is not None:
            self.refused.append(Refused(name, f"would break a limit: {broken}"))
            return None
        return made

    def _made(self, name: str, option: Option, total_s: float, instead: Proposal) -> Proposal:
        cycle, change = option
        durations = cycle.durations(change, total_s)
        motion, program = cycle.timed(change, durations)
        use = self._use(motion)
        waiting_s = max(
            total_s - cycle.seconds, 0.0
        )  # of the motion as it is, in a posture that the cycle may not have
        half = self._half(instead.use, use, cycle.unlike_s(change, durations) + at_rest(waiting_s))
        if half is not None:
            half = max(half, _NUMERICAL * instead.use.energy)
        return Proposal(name, motion, program, use, instead.use.energy - use.energy, half, change.brakes_after)

    def _use(self, motion: Motion) -> Use:
        return self.subject.meter.use(motion)

    def _half(self, before: Use, after: Use, unlike_s: float) -> float | None:
        doubt = self.subject.doubt
        return None if doubt is None else doubt.half_width(before, after, unlike_s)

    def pareto(self, best: Option, uniform: Option) -> Pareto:
        """Energy against cycle time, of the best change and of plain uniform slowing."""
        now = self._as_it_is(self._seconds)
        pareto = Pareto([], [], [], [], [])
        for share in _PARETO:
            seconds = share * self._seconds
            try:
                use = self._made("", best, seconds, now).use
            except UserError:
                continue
            slower = share >= 1.0
            pareto.seconds.append(seconds)
            pareto.best.append(use.energy)
            pareto.uniform.append(self._made("", uniform, seconds, now).use.energy if slower else float("nan"))
            pareto.waiting.append(self._as_it_is(seconds).use.energy if slower else float("nan"))
            pareto.standby.append(use.causes.get(Cause.STANDBY, 0.0))
        return pareto

    def what_ifs(self, payload_kg: float | None) -> list[WhatIf]:
        """What the motion as it is would have used in another state of the robot."""
        meter, motion = self.subject.meter, self.subject.motion
        now = self._use(motion)
        states: dict[str, Use] = {}
        if payload_kg is not None:
            states[f"{payload_kg:+g} kg at the flange"] = meter.with_mass(payload_kg).use(motion)
        if starts := meter.cold_starts():
            states["gears as cold as at the start of a session"] = meter.use(motion, min(starts))
        return [
            WhatIf(name, use.energy, now.energy - use.energy, self._half(now, use, 2 * now.seconds))
            for name, use in states.items()
        ]


def _unknown(subject: Subject) -> list[str]:
    """What the model cannot tell, in sentences."""
    said = []
    if not subject.motion.tool_on.any():
        said.append("which pauses the process needs: no tool switches in this motion; --keep-waits keeps all of them")
    if not subject.meter.knows_brakes:
        said.append("brakes: the logs that the model has learned from had no brake signal")
    if not subject.meter.cold_starts():
        said.append("warm-up: the loop has added no friction of cold gears to this model; it predicts warm gears only")
    return said
