"""Pick-and-place programs that the foreign plants execute: quintic moves between points, short holds, and waits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker, dense_path
from acqd.robot.description import RobotDescription
from acqd.robot.scene import load_scene
from tools.studies.foreign.generator.arm import Floats
from tools.studies.foreign.generator.motion import STEP_S

_POINTS = 5
_REACH_RAD = 2.0
"""Largest angle of a joint from the middle of its range."""
_LONGEST_WAY = 1.2
"""rad from one point to the next."""
_SPEED, _HOLD_S, _WAIT_S = (0.25, 0.7), (0.3, 0.6), (1.0, 5.0)
_REST_S = 1.0
_CHECK_RAD = np.radians(2.0)


@dataclass(frozen=True, slots=True)
class Executed:
    """Motion of a program at STEP_S."""

    q: Floats
    qd: Floats
    qdd: Floats


def pick_and_place(robot: RobotDescription, seconds: float, random: np.random.Generator) -> Executed:
    """A program of about so many seconds that goes round some points, free of collisions with itself."""
    arm = Arm(robot)
    checker = CollisionChecker(arm, load_scene("free"))
    points = _points(robot, checker, random)
    parts = [_hold(points[0], _REST_S)]
    at = 0
    while sum(len(part.q) for part in parts) * STEP_S < seconds:
        after = (at + 1) % len(points)
        override = float(random.uniform(*_SPEED))
        parts.append(_move(robot, points[at], points[after], override))
        waits = random.random() < 0.3
        parts.append(_hold(points[after], float(random.uniform(*(_WAIT_S if waits else _HOLD_S)))))
        at = after
    parts.append(_hold(points[at], _REST_S))
    return Executed(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("q", "qd", "qdd")))


def _points(robot: RobotDescription, checker: CollisionChecker, random: np.random.Generator) -> list[Floats]:
    """Points whose straight ways, also back to the first, are free."""
    middle, reach = (robot.lower + robot.upper) / 2, np.minimum(0.7 * (robot.upper - robot.lower) / 2, _REACH_RAD)
    low, high = middle - reach, middle + reach

    def free(a: Floats, b: Floats) -> bool:
        return not checker.path_collides(dense_path(np.array([a, b]), _CHECK_RAD))

    while True:
        first = random.uniform(low, high)
        points = [first]
        for _ in range(200):
            if len(points) == _POINTS:
                return points
            way = random.uniform(-_LONGEST_WAY, _LONGEST_WAY, robot.axes)
            point = np.clip(points[-1] + way, low, high)
            closes = len(points) < _POINTS - 1 or free(point, first)
            if free(points[-1], point) and closes:
                points.append(point)


def _hold(q: Floats, seconds: float) -> Executed:
    still = np.zeros((round(seconds / STEP_S), len(q)))
    return Executed(still + q, still, still)


def _move(robot: RobotDescription, start: Floats, end: Floats, override: float) -> Executed:
    """Minimum jerk (Flash and Hogan 1985); the greatest speed is 1.875, the greatest acceleration 5.774 of the mean."""
    way = end - start
    by_speed = float((1.875 * np.abs(way) / (override * robot.speed)).max())
    by_acceleration = float(np.sqrt(5.774 * np.abs(way) / (0.6 * override * robot.acceleration)).max())
    rows = max(round(max(by_speed, by_acceleration) / STEP_S), 20)
    u, duration = (np.arange(rows) + 1) / rows, rows * STEP_S
    s, v, a = 10 * u**3 - 15 * u**4 + 6 * u**5, 30 * u**2 * (1 - u) ** 2, 60 * u * (1 - u) * (1 - 2 * u)
    return Executed(start + np.outer(s, way), np.outer(v, way) / duration, np.outer(a, way) / duration**2)
