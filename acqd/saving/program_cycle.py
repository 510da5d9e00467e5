"""The cycle of a program: other speeds and accelerations of its motions, which any controller can be told.

All motions between two stops get one factor on their speeds and one on their accelerations. What these use is computed
for a grid of both, with every blend as the controller plans it; steps that exceed a limit are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.optimize import brentq

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.motion.chain import Chain, Move, plan_chain
from acqd.motion.controller import RATE, BrakeSettings, Controller, Motion, Step, SwitchTool, Wait
from acqd.motion.program_file import Program
from acqd.saving.cycle import Rest
from acqd.saving.plan import UNIFORM, Change, Cycle, Piece, Timing
from acqd.saving.power import Meter
from acqd.saving.sharing import Curve
from acqd.saving.time_law import Bounds

SPEED, ACCELERATION, BOTH = "speeds", "accelerations", "speeds and accelerations"
_SPEEDS = (0.25, 0.35, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3, 1.6, 2.0, 2.5)
_ACCELERATIONS = (0.15, 0.25, 0.4, 0.6, 0.8, 1.0, 1.3, 1.8, 2.5, 4.0)
_POINT_S = 0.02
_SLACK = 1 + 1e-6
_SLOWEST, _EXACT = 100.0, 1e-4


class ChainTiming(Timing):
    """Motions between two stops with other speeds and accelerations."""

    laws = (SPEED, ACCELERATION, BOTH)

    def __init__(self, origin: Floats, moves: Sequence[Move], bounds: Bounds, meter: Meter) -> None:
        self._origin, self._moves, self._bounds, self._meter = origin, list(moves), bounds, meter
        self._known: dict[tuple[str, float], tuple[float, float]] = {}
        self.seconds = self._chain(1.0, 1.0).duration
        pairs = [(v, a) for v, a in product(_SPEEDS, _ACCELERATIONS) if (v == 1.0 and a == 1.0) or self._may(v, a)]
        chains = [self._chain(*pair) for pair in pairs]
        energies, keeps = self._judged(chains)
        kept = [k for k, pair in enumerate(pairs) if keeps[k] or pair == (1.0, 1.0)]
        self._pairs = [pairs[k] for k in kept]
        self._seconds = np.array([chains[k].duration for k in kept])
        self._energy = energies[kept]
        self._curves = {law: self._curve(law) for law in self.laws}

    def curve(self, law: str) -> Curve:
        """Of the grid's points that a law may use."""
        return self._curves[law][0]

    def moves(self, law: str, seconds: float) -> list[Move]:
        """The motions with a duration: with the factors of the next shorter duration, slowed uniformly."""
        return self._scaled(*self._factors(law, seconds))

    def unlike(self, law: str, seconds: float) -> float:
        """From the factors: speeds in the middle, and the roots of accelerations where the motion begins and ends."""
        speed, acceleration = self._factors(law, seconds)
        middle, ends = float(np.log(speed)), float(np.log(acceleration)) / 2
        return (middle**2 + ends**2) / 2

    def _factors(self, law: str, seconds: float) -> tuple[float, float]:
        """On speeds and accelerations."""
        if (law, seconds) not in self._known:
            self._known[law, seconds] = self._sought(law, seconds)
        return self._known[law, seconds]

    def _sought(self, law: str, seconds: float) -> tuple[float, float]:
        curve, pairs = self._curves.get(law, self._curves[BOTH])
        number = max(int(np.searchsorted(curve.seconds, seconds + 1e-9, side="right")) - 1, 0)
        speed, acceleration = (1.0, 1.0) if law == UNIFORM else pairs[number]

        def late(slower: float) -> float:
            return self._chain(speed / slower, acceleration / slower**2).duration - seconds

        slowest = 1.0
        while late(slowest) < 0 and slowest < _SLOWEST:
            slowest *= 1.5
        if late(slowest) < -_EXACT:
            raise UserError(f"a motion of {seconds:.2f} s is more than {_SLOWEST:g} times slower than the program's")
        slower = brentq(late, 1.0, slowest, xtol=_EXACT) if late(1.0) < 0 < late(slowest) else 1.0
        return speed / slower, acceleration / slower**2

    def _curve(self, law: str) -> tuple[Curve, list[tuple[float, float]]]:
        may = [
            k
            for k, (v, a) in enumerate(self._pairs)
            if (law != SPEED or a == 1.0) and (law != ACCELERATION or v == 1.0)
        ]
        hull = Curve.hull(self._seconds[may], self._energy[may])
        return hull, [self._pairs[may[k]] for k in hull.number]

    def _may(self, speed: float, acceleration: float) -> bool:
        """Whether shares of speeds and accelerations stay at or below 1."""
        return all(
            speed * move.relative_speed <= 1.0 and acceleration * move.relative_acceleration <= 1.0
            for move in self._moves
        )

    def _scaled(self, speed: float, acceleration: float) -> list[Move]:
        return [
            replace(
                move, relative_speed=speed * move.relative_speed,
                relative_acceleration=acceleration * move.relative_acceleration,
            )
            for move in self._moves
        ]  # fmt: skip

    def _chain(self, speed: float, acceleration: float) -> Chain:
        robot = self._bounds.robot
        return plan_chain(self._origin, self._scaled(speed, acceleration), robot.speed, robot.acceleration)

    def _judged(self, chains: Sequence[Chain]) -> tuple[Floats, list[bool]]:
        """[n] J of the drives, and whether a chain keeps speeds, accelerations and torques."""
        times = [np.linspace(0.0, chain.duration, max(round(chain.duration / _POINT_S), 8)) for chain in chains]
        sampled = [chain.sample(t) for chain, t in zip(chains, times, strict=True)]
        q, qd, qdd = (np.concatenate([each[k] for each in sampled]) for k in range(3))
        grey, bounds = self._meter.grey, self._bounds
        power = grey.drive_power(grey.rigid_torque(q, qd, qdd), qd, qdd)
        good = (
            (np.abs(qd) <= bounds.speed * _SLACK).all(axis=1)
            & (np.abs(qdd) <= bounds.acceleration * _SLACK).all(axis=1)
            & (np.abs(bounds.rigid_torque(q, qd, qdd)) <= bounds.robot.effort * _SLACK).all(axis=1)
        )
        ends = np.cumsum([len(t) for t in times])[:-1]
        energies = [np.trapezoid(p, t) for p, t in zip(np.split(power, ends), times, strict=True)]
        return np.array(energies), [bool(each.all()) for each in np.split(good, ends)]


class ProgramCycle(Cycle):
    """Steps of a program."""

    def __init__(
        self, program: Program, bounds: Bounds, meter: Meter, least_rest: float
    ) -> None:  # fmt: skip
        self.meter, self.least_rest, self._bounds, self._robot = meter, least_rest, bounds, bounds.robot
        self._judged: dict[bytes, ChainTiming] = {}
        self._set(program)

    def with_program(self, program: Program, strange_s: float) -> ProgramCycle:
        """Another program; motions that stay are not judged again."""
        other = copy(self)
        other._set(program)
        other.strange_s = strange_s
        return other

    def _set(self, program: Program) -> None:
        self._program, self._judged = program, dict(self._judged)
        self._items: list[list[Step]] = []
        for step in program.steps:
            if isinstance(step, Move) and self._items and isinstance(self._items[-1][-1], Move):
                self._items[-1].append(step)
            else:
                self._items.append([step])
        self.pieces, self._owner = [], []
        at = program.start
        moving = [k for k, item in enumerate(self._items) if isinstance(item[0], Move)]
        for number, item in enumerate(self._items):
            piece = self._piece(item, at, outer=not moving or not moving[0] < number < moving[-1])
            if isinstance(item[-1], Move):
                at = item[-1].target
            if piece is not None:
                self.pieces.append(piece)
                self._owner.append(number)
        self.seconds = program.motion(self._robot).seconds

    def _piece(self, item: Sequence[Step], at: Floats, *, outer: bool) -> Piece | None:
        first = item[0]
        if isinstance(first, Move):
            return self._chain(at, [step for step in item if isinstance(step, Move)])
        if isinstance(first, Wait | SwitchTool):
            rows = np.ones(max(round(first.seconds * RATE), 1), bool)
            return Rest(at, first.seconds, rows, ~rows, isinstance(first, SwitchTool), outer)
        return None

    def _chain(self, at: Floats, moves: Sequence[Move]) -> ChainTiming | None:
        """None for motions of no length."""
        if not plan_chain(at, list(moves), self._robot.speed, self._robot.acceleration).legs:
            return None
        rates = [(move.relative_speed, move.relative_acceleration, move.blend_after) for move in moves]
        key = np.concatenate([at, *(move.target for move in moves), np.ravel(rates)]).tobytes()
        if key not in self._judged:
            self._judged[key] = ChainTiming(at, moves, self._bounds, self.meter)
        return self._judged[key]

    def timed(self, change: Change, durations: Sequence[float]) -> tuple[Motion, Program | None]:
        """The program with other motions and pauses, and its motion."""
        items = [list(item) for item in self._items]
        for number, piece, seconds in zip(self._owner, self.pieces, durations, strict=True):
            if isinstance(piece, ChainTiming) and change.law:
                items[number] = list(piece.moves(change.law, seconds))
            elif isinstance(items[number][0], Wait):
                items[number] = [Wait(seconds)]
        steps = [step for item in items for step in item]
        brakes = BrakeSettings()
        if change.brakes_after is not None:
            steps = _with_time_to_release(steps, change.brakes_after)
            brakes = BrakeSettings(close_after_s=change.brakes_after)
        program = Program(self._program.start, tuple(steps))
        return Controller(self._robot, program.start, brakes).run(steps), program


def _with_time_to_release(steps: Sequence[Step], after_s: float) -> list[Step]:
    """Steps in which pauses are shorter by the time that opening the brakes takes, where they will have closed."""
    usual = BrakeSettings()
    out, still, longest = list(steps), 0.0, -1
    for number, step in enumerate([*steps, None]):
        if isinstance(step, Wait | SwitchTool):
            still += step.seconds
            pause = out[longest] if longest >= 0 else None
            if isinstance(step, Wait) and (not isinstance(pause, Wait) or step.seconds > pause.seconds):
                longest = number
        elif isinstance(step, Move):
            pause = out[longest] if longest >= 0 else None
            closes = after_s + usual.release_s < still <= usual.close_after_s
            if closes and isinstance(pause, Wait) and pause.seconds > usual.release_s:
                out[longest] = Wait(pause.seconds - usual.release_s)
            still, longest = 0.0, -1
    return out
