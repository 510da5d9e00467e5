"""Random excitation trajectories in limited space (Algorithm 1 of the thesis) and in all space (Algorithm 2)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.motion.chain import Move, plan_chain
from acqd.motion.trajectory import Trajectory
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker, dense_path, require_free
from acqd.robot.kinematics import Pose, inverse_kinematics, unwound

TOOL_DOWN = np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
"""End-effector orientation of Algorithm 1."""
CHECK_STEP = np.radians(2.0)
"""Largest axis step between two collision checks."""
_MAX_FAILURES = 600  # consecutive rejected draws after which a space counts as impossible
_MAX_FAILURES_AT_START = 60  # before the first accepted draw; inverse kinematics of unreachable points is slow


@dataclass(frozen=True, slots=True)
class Cube:
    """The volume of Algorithm 1."""

    centre: tuple[float, float, float] = (0.6, 0.0, 0.34)
    """m."""
    edge: float = 0.3
    """m."""
    points: tuple[int, int] = (40, 60)
    """Least and greatest number of points."""


@dataclass(slots=True)
class Tally:
    """Number of accepted points, and of rejected draws by reason."""

    points: int = 0
    unreachable: int = 0
    colliding: int = 0
    outside_limits: int = 0


@dataclass(frozen=True, slots=True)
class Excitation:
    """Draws trajectories for one arm in one scene; the tally counts over all of them."""

    arm: Arm
    checker: CollisionChecker
    scene: str
    thesis: bool = False
    """Check the paths at only 10 evenly spaced points, as in the thesis."""
    tally: Tally = field(default_factory=Tally)

    def limited_space(self, name: str, cube: Cube, random: np.random.Generator) -> Trajectory:
        """Algorithm 1: random points in the cube with the tool down. Raises UserError for an unreachable cube."""
        count = int(random.integers(cube.points[0], cube.points[1] + 1))
        centre, half = np.array(cube.centre), cube.edge / 2
        seed = self._central_configuration(centre, random)
        waypoints: list[Floats] = []
        failures = 0
        while len(waypoints) < count:
            if failures >= (_MAX_FAILURES if waypoints else _MAX_FAILURES_AT_START):
                raise UserError(
                    f"cube at {_metres(centre)} with edge {cube.edge:g} m: {failures} points in a row could not be "
                    f"reached by {self.arm.description.name} with the tool down and without collision; "
                    "move it or make it smaller"
                )
            failures += 1
            pose = Pose(centre + random.uniform(-half, half, 3), TOOL_DOWN)
            q = inverse_kinematics(self.arm, pose, waypoints[-1] if waypoints else seed, random)
            if q is None:
                self.tally.unreachable += 1
            elif self._accepts(waypoints, q):
                waypoints.append(q)
                failures = 0
        self.tally.points += count
        return Trajectory(name, np.array(waypoints))

    def all_space(self, name: str, random: np.random.Generator) -> Trajectory:
        """Algorithm 2: 10 to 20 random configurations after the start with all axes at 0. Raises UserError."""
        robot = self.arm.description
        start = np.zeros(robot.axes)
        require_free(self.checker, start, "the start position (all axes 0)", self.scene)
        lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
        count = int(random.integers(10, 21))
        waypoints = [start]
        failures = 0
        while len(waypoints) <= count:
            if failures > _MAX_FAILURES:
                raise UserError(
                    f"scene {self.scene}: {failures} random positions in a row of {robot.name} collide; "
                    "the boxes leave no room to move"
                )
            failures += 1
            q = random.uniform(lower, upper)
            if self._accepts(waypoints, q):
                waypoints.append(q)
                failures = 0
        self.tally.points += count
        return Trajectory(name, np.array(waypoints))

    def _central_configuration(self, centre: Floats, random: np.random.Generator) -> Floats:
        """The configuration [axes] at the cube's centre that, of 12 tries, is farthest from the axis limits."""
        robot = self.arm.description
        middle, half_range = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
        least_strain, best = np.inf, middle
        for _ in range(12):
            start = random.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)) * 0.6
            q = inverse_kinematics(self.arm, Pose(centre, TOOL_DOWN), start, random, restarts=10)
            if q is not None:  # every path to this point would repeat a superfluous turn
                q = unwound(q, middle, robot.lower, robot.upper)
            if q is not None and not self.checker.collides(q):
                strain = float(np.max(np.abs(q - middle) / half_range))
                if strain < least_strain:
                    least_strain, best = strain, q
        return best

    def _accepts(self, waypoints: list[Floats], q: Floats) -> bool:
        """Whether `q` and the path to it, with and without blending, are free of collisions. Counts a collision."""
        if not waypoints:
            collides = self.checker.collides(q)
        elif self.thesis:
            start = waypoints[-1]
            collides = any(self.checker.collides(p) for p in start + np.linspace(0, 1, 10)[:, None] * (q - start))
        else:
            corner = np.array([*waypoints[-2:], q])
            collides = self.checker.path_collides(dense_path(corner[-2:], CHECK_STEP)) or self._corner_collides(corner)
        if collides:
            self.tally.colliding += 1
        return not collides

    def _corner_collides(self, corner: Floats) -> bool:
        """Whether the widest blend of a corner [3, axes] collides; narrower blends lie between it and the corner."""
        if len(corner) < 3:
            return False
        robot = self.arm.description
        moves = [Move(q, 0.5, 0.2, blend_after=0.5) for q in corner[1:]]
        first, second = plan_chain(corner[0], moves, robot.speed, robot.acceleration).legs
        t = np.arange(second.start, first.end, 1e-2)
        s_old, s_new = first.profile.at(t - first.start)[0], second.profile.at(t - second.start)[0]
        cut = corner[0] + s_old[:, None] * first.distance + s_new[:, None] * second.distance
        return self.checker.path_collides(planned_path(cut))


def planned_path(q: Floats) -> Floats:
    """Rows of a sampled path [T, axes] between which no axis moves more than CHECK_STEP."""
    if len(q) < 2:
        return q
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1))])
    steps = np.arange(0.0, travelled[-1] + CHECK_STEP, CHECK_STEP * 0.95)
    chosen = np.unique(np.concatenate([np.searchsorted(travelled, steps).clip(max=len(q) - 1), [len(q) - 1]]))
    return np.asarray(q[chosen])


def _metres(point: Floats) -> str:
    return " ".join(f"{value:g}" for value in point) + " m"
