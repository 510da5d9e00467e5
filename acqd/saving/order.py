"""Another order of the points of a program, where the order is free: the round that costs least.

A visit is a motion with the pauses after it. The first position and the last point stay. The way from point to point is
straight and unblended, and has to be free of collisions; the best order is exact up to ten visits (Held and Karp 1962),
and beyond found by exchanging parts of the round (2-opt; Croes 1958).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.motion.chain import Move, plan_chain
from acqd.motion.controller import Step, SwitchTool
from acqd.motion.excitation import CHECK_STEP
from acqd.motion.program_file import Program
from acqd.robot.collision import CollisionChecker, dense_path
from acqd.robot.description import RobotDescription
from acqd.saving.power import Meter

_EXACT = 10
_POINT_S = 0.02


def require_free_order(program: Program | None, name: object) -> None:
    """Raise UserError for a log, and for a program in which the order of points means something."""
    if program is None:
        raise UserError(f"{name}: --free-order needs a program file: a log does not say what its points are")
    if any(isinstance(step, SwitchTool) for step in program.steps):
        raise UserError(f"{name}: switches the tool, so that the order of its points is not free")


def reordered(program: Program, robot: RobotDescription, checker: CollisionChecker, meter: Meter) -> Program | None:
    """The program in the best order; None if that is the order it has."""
    before, visits = _visits(program.steps)
    if len(visits) < 3:
        return None
    targets = [program.start, *(visit[0].target for visit in visits)]
    cost = np.full((len(targets), len(targets)), np.inf)
    for a in range(len(visits)):  # from the start or any visit but the last
        for b in range(1, len(targets)):
            if a != b and not checker.path_collides(dense_path(np.array([targets[a], targets[b]]), CHECK_STEP)):
                cost[a, b] = _cost(targets[a], visits[b - 1][0], robot, meter)
    order = _exact(cost) if len(visits) - 1 <= _EXACT else _exchanged(cost)
    if order == list(range(1, len(targets))):
        return None
    steps = [*before]
    for number in order:
        move, *after = visits[number - 1]
        steps += [replace(move, blend_after=1.0), *after]
    return Program(program.start, tuple(steps))


def _visits(steps: Sequence[Step]) -> tuple[list[Step], list[tuple[Move, *tuple[Step, ...]]]]:
    """Steps before the first motion, and each motion with the steps after it."""
    before: list[Step] = []
    visits: list[tuple[Move, *tuple[Step, ...]]] = []
    for step in steps:
        if isinstance(step, Move):
            visits.append((step,))
        elif visits:
            visits[-1] = (*visits[-1], step)
        else:
            before.append(step)
    return before, visits


def _cost(start: Floats, move: Move, robot: RobotDescription, meter: Meter) -> float:
    """J of the drives on the way, and what holding the arm there would take in that time: time can be used better."""
    chain = plan_chain(start, [move], robot.speed, robot.acceleration)
    if not chain.legs:
        return 0.0
    t = np.linspace(0.0, chain.duration, max(round(chain.duration / _POINT_S), 8))
    q, qd, qdd = chain.sample(t)
    power = meter.grey.drive_power(meter.grey.rigid_torque(q, qd, qdd), qd, qdd)
    return float(np.trapezoid(power, t)) + chain.duration * float(meter.holding(move.target[None])[0])


def _exact(cost: Floats) -> list[int]:
    """Order of the points 1 .. n after 0, the last of which stays last, of least cost."""
    last = len(cost) - 1
    best: dict[tuple[frozenset[int], int], tuple[float, list[int]]] = {
        (frozenset([k]), k): (float(cost[0, k]), [k]) for k in range(1, last)
    }
    for size in range(2, last):
        for chosen in combinations(range(1, last), size):
            visited = frozenset(chosen)
            for k in chosen:
                ways = [best[visited - {k}, j] for j in chosen if j != k]
                best[visited, k] = min(
                    ((length + float(cost[way[-1], k]), [*way, k]) for length, way in ways), key=lambda each: each[0]
                )
    whole = frozenset(range(1, last))
    ends = [best[whole, k] for k in range(1, last)]
    _, order = min(((length + float(cost[way[-1], last]), way) for length, way in ends), key=lambda each: each[0])
    return [*order, last]


def _exchanged(cost: Floats) -> list[int]:
    """The same by exchanges, from the order that the program has."""
    order = list(range(len(cost)))

    def length(way: list[int]) -> float:
        return float(cost[way[:-1], way[1:]].sum())

    better = True
    while better:
        better = False
        for a, b in combinations(range(1, len(order) - 1), 2):
            trial = [*order[:a], *order[a : b + 1][::-1], *order[b + 1 :]]
            if length(trial) < length(order) - 1e-9:
                order, better = trial, True
    return order[1:]
