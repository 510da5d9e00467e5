"""Programs for the virtual controller: a source trajectory with random motion parameters (thesis, Listing 5.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.motion.chain import Chain, Move, plan_chain
from acqd.motion.controller import Step, Wait
from acqd.motion.excitation import CHECK_STEP, planned_path
from acqd.motion.path_planning import find_path
from acqd.motion.trajectory import Trajectory
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker, dense_path
from acqd.robot.kinematics import forward_kinematics


@dataclass(frozen=True, slots=True)
class MotionParameters:
    """Ranges of the random parameters of each motion (thesis, Listing 5.1)."""

    relative_speed: tuple[float, float] = (0.2, 0.5)
    relative_blending: tuple[float, float] = (0.0, 0.5)
    relative_acceleration: float = 0.2


@dataclass(frozen=True, slots=True)
class Planner:
    """Turns trajectories into collision-free programs."""

    arm: Arm
    checker: CollisionChecker
    parameters: MotionParameters = MotionParameters()

    def program(self, trajectory: Trajectory, random: np.random.Generator, before_s: float = 1.0) -> list[Step]:
        """Program of a trajectory: wait, visit its waypoints with random speed and blending, wait. Raises UserError."""
        steps: list[Step] = [Wait(before_s)]
        try:
            steps += self.moves(trajectory.waypoints, random)
        except UserError as error:
            raise UserError(f"{trajectory.name}: {error}") from None
        return [*steps, Wait(1.0)]

    def moves(self, waypoints: Floats, random: np.random.Generator) -> list[Move]:
        """Motions through `waypoints` [N, axes], blended at every corner whose blend is free. Raises UserError."""
        moves = []
        for start, end in pairwise(waypoints):
            if np.abs(end - start).max() <= 1e-9:  # a repeated position needs no motion
                continue
            moves.append(
                Move(
                    target=end,
                    relative_speed=float(random.uniform(*self.parameters.relative_speed)),
                    relative_acceleration=self.parameters.relative_acceleration,
                    blend_after=self.blend_after(start, end, float(random.uniform(*self.parameters.relative_blending))),
                )
            )
        return self.without_collisions(waypoints[0], moves)

    def blend_after(self, start: Floats, end: Floats, relative_blending: float) -> float:
        """Path parameter at which the last share `relative_blending` of the Cartesian path starts (thesis 5.3)."""
        s = np.linspace(0.0, 1.0, 33)
        positions, _ = forward_kinematics(self.arm, start + s[:, None] * (end - start))
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
        if length[-1] < 1e-6:  # the flange turns on the spot
            return 1.0 - relative_blending
        return float(np.interp((1.0 - relative_blending) * length[-1], length, s))

    def connect(self, start: Floats, end: Floats) -> list[Move]:
        """Collision-free motions from `start` to `end`, with a detour where needed. Raises UserError."""
        robot = self.arm.description
        limits = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
        path = find_path(self.checker, start, end, limits, CHECK_STEP)
        if path is None:
            raise UserError("no collision-free path from one trajectory to the next was found; change the scene")
        return [Move(q, 0.3, self.parameters.relative_acceleration) for q in path]

    def without_collisions(self, origin: Floats, moves: list[Move]) -> list[Move]:
        """The same motions, unblended where the blend would collide. No motion may have zero length.

        Raises UserError when a motion collides even without blending.
        """
        robot = self.arm.description
        while True:  # each round removes one blend, or raises
            chain = plan_chain(origin, moves, robot.speed, robot.acceleration)
            time = self._first_collision(chain)
            if time is None:
                return moves
            moves = self._unblended(moves, chain, time)

    def _first_collision(self, chain: Chain) -> float | None:
        """Time (s) of the first collision along a chain, None without a collision."""
        t = np.arange(0.0, chain.duration, 4e-3)
        q = chain.sample(t)[0]
        if not self.checker.path_collides(planned_path(q)):
            return None
        times = (float(t[k]) for k in range(len(q)) if self.checker.collides(q[k]))
        return next((time for time in times if not self._was_drawn_free(chain, time)), None)

    def _was_drawn_free(self, chain: Chain, time: float) -> bool:
        """Whether the straight path of the only motion at `time` (s) is free where it was checked when it was drawn.

        Between two of those positions a path may come nearer than the scene's margin, which is there to cover that.
        """
        active = chain.active(time)
        if len(active) > 1:
            return False
        start = chain.origin + sum((leg.distance for leg in chain.legs[: active[0]]), np.zeros_like(chain.origin))
        straight = np.array([start, start + chain.legs[active[0]].distance])
        return not self.checker.path_collides(dense_path(straight, CHECK_STEP))

    def _unblended(self, moves: list[Move], chain: Chain, time: float) -> list[Move]:
        """The motions without the blend that is active at `time` (s). Raises UserError without an active blend."""
        active = chain.active(time)
        before = min(active)
        if len(active) < 2 or moves[before].blend_after >= 1.0:
            target = " ".join(f"{angle:.0f}" for angle in np.degrees(moves[before].target))
            raise UserError(
                f"the straight path to {target} deg collides (checked every {np.degrees(CHECK_STEP):g} deg); "
                "draw the trajectories with this scene, or choose the scene that they were drawn with (--scene)"
            )
        return [replace(move, blend_after=1.0) if k == before else move for k, move in enumerate(moves)]
