"""Pieces of motion that a program is chosen from; each begins and ends at home, so that any sequence of them is free.

Every kind shows another part of an effect: turns of one joint at three speeds tell friction laws from losses, holds
tell gravity, short strokes tell inertia, rests tell what acts without motion, and random motion (thesis, 5.1) has some
of all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.experiment.space import Space
from acqd.motion.chain import Move
from acqd.motion.controller import BrakeSettings, Controller, Motion, Step, Wait
from acqd.robot.inertia import gravity_torque

SPEEDS = {"slow": 0.1, "half speed": 0.4, "full speed": 1.0}
"""Shares of the greatest speed of a joint."""
_TURN, _STROKE = 1.2, 0.15
"""rad: longest turn of one joint to a side, and a short stroke."""
_PIECE_S = 6.0
"""A piece repeats its turns until this time has passed; slow turns are short enough to fit."""
_HOLD_S, _REST_S = 4.0, 14.0
"""A rest is longer than brakes wait before they close."""
_NUDGE = 0.02
"""rad: a motion that opens the brakes."""
_HOLDS, _RANDOM, _RANDOM_MOVES = 6, 18, 5
_BRIEF_S = 0.4
"""At home, between two pieces."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A part of a program, from home to home."""

    name: str
    """What moves, for people."""
    random: bool
    """Whether the piece is motion of the thesis' kind."""
    steps: tuple[Step, ...]
    seconds: float


def pieces_of(space: Space, seed: int, longest_s: float = np.inf) -> list[Piece]:
    """All pieces of at most `longest_s` that keep the limits."""
    random = np.random.default_rng(seed)
    pieces = []
    for name, moves in _kinds(space, random):
        piece = _piece(space, name, moves, longest_s)
        if piece is not None:
            pieces.append(piece)
    return pieces


def motion_of(space: Space, steps: tuple[Step, ...], brakes: BrakeSettings | None = None) -> Motion:
    """A program from home, executed at 1 kHz."""
    return Controller(space.arm.description, space.home, brakes).run(list(steps))


def _piece(space: Space, name: str, steps: list[Step], longest_s: float) -> Piece | None:
    """None for motion that exceeds a limit, collides or takes longer than `longest_s`."""
    whole = (*steps, Move(space.home, *_rates(space, space.home - _end(space, steps))), Wait(_BRIEF_S))
    if least_s(space, whole) > longest_s:  # before hours of slow motion are executed at 1 kHz
        return None
    motion = motion_of(space, whole)
    if motion.seconds > longest_s or space.broken_limit(motion):
        return None
    return Piece(name, name.startswith("random"), whole, motion.seconds)


def _kinds(space: Space, random: np.random.Generator) -> Iterator[tuple[str, list[Step]]]:
    postures = {"home": space.home, **_extremes(space)}
    joints = {axis: space.arm.description.joint[axis].name for axis in space.turning(_STROKE)}
    for where, posture in postures.items():
        for axis, joint in joints.items():
            for speed, share in SPEEDS.items():
                yield f"{joint} {speed} from {where}", _turns(space, posture, axis, share, _TURN)
    for axis, joint in joints.items():
        yield f"{joint} short strokes", _turns(space, space.home, axis, 1.0, _STROKE)
    for number in range(_HOLDS):
        posture = space.postures[random.integers(len(space.postures))]
        yield f"hold {number + 1}", [_to(space, space.home, posture), Wait(_HOLD_S)]
    for where, posture in postures.items():
        yield f"hold {where}", [_to(space, space.home, posture), Wait(_HOLD_S)]
    if joints:  # the brakes open, and close again while the arm rests
        stroke = space.home + _NUDGE * (np.arange(space.arm.axes) == next(iter(joints)))
        yield "rest", [_to(space, space.home, stroke), _to(space, stroke, space.home), Wait(_REST_S)]
    for number in range(_RANDOM):
        yield f"random {number + 1}", _random(space, random)


def _extremes(space: Space) -> dict[str, Floats]:
    """Measured postures with the greatest and the least torque against gravity."""
    load = np.linalg.norm(gravity_torque(space.arm.description, space.postures), axis=1)
    return {"stretched": space.postures[load.argmax()], "folded": space.postures[load.argmin()]}


def _turns(space: Space, posture: Floats, axis: int, share: float, reach: float) -> list[Step]:
    """One joint to and fro about a posture until the time of a piece has passed, within measured positions."""
    reach = min(reach, share * space.speed[axis] * _PIECE_S / 4)
    low = max(posture[axis] - reach, space.low[axis])
    high = min(posture[axis] + reach, space.high[axis])
    one_way = (high - low) / (share * space.speed[axis]) + share * space.speed[axis] / space.acceleration[axis]
    ends = np.tile(posture, (2, 1))
    ends[:, axis] = high, low
    steps: list[Step] = [_to(space, space.home, posture)]
    position = posture
    for k in range(max(2, 2 * round(_PIECE_S / one_way / 2))):
        end = ends[k % 2]
        steps.append(_to(space, position, end, share))
        position = end
    steps.append(_to(space, position, posture))
    return steps


def _random(space: Space, random: np.random.Generator) -> list[Step]:
    """Measured positions in random order, at random speeds."""
    chosen = space.postures[random.integers(len(space.postures), size=_RANDOM_MOVES)]
    starts = [space.home, *chosen[:-1]]
    return [_to(space, start, end, float(random.uniform(0.2, 1.0))) for start, end in zip(starts, chosen, strict=True)]


def _to(space: Space, start: Floats, end: Floats, share: float = 1.0) -> Move:
    return Move(end, *_rates(space, end - start, share))


def _rates(space: Space, distance: Floats, share: float = 1.0) -> tuple[float, float]:
    """Relative speed and acceleration of the fastest synchronous motion that keeps those of all joints."""
    robot, moves = space.arm.description, np.abs(distance) > 1e-9
    if not moves.any():
        return share, share
    length = np.abs(distance[moves])
    return (
        share * float((space.speed[moves] / length).min() / (robot.speed[moves] / length).min()),
        float((space.acceleration[moves] / length).min() / (robot.acceleration[moves] / length).min()),
    )


def least_s(space: Space, steps: tuple[Step, ...]) -> float:
    """Time [s] that no execution of the steps from home falls short of."""
    position, seconds = space.home, 0.0
    for step in steps:
        if isinstance(step, Wait):
            seconds += step.seconds
        elif isinstance(step, Move):
            speed = step.relative_speed * space.arm.description.speed
            seconds += float((np.abs(step.target - position) / speed).max())
            position = step.target
    return seconds


def _end(space: Space, steps: list[Step]) -> Floats:
    targets = [step.target for step in steps if isinstance(step, Move)]
    return targets[-1] if targets else space.home
