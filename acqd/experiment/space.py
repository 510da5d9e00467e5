"""Where a designed motion may go and how fast: measured positions and speeds, limits of the robot, obstacles.

The model has learned where and how fast the robot has moved, and a name must show at speeds of the reference (ADR 54).
A motion beyond both would ask the model what it cannot know.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.segments import Segment
from acqd.motion.controller import Motion
from acqd.motion.limits import MotionLimits, within
from acqd.motion.profile import SMOOTHING_S
from acqd.residual.thresholds import NOISE
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker
from acqd.robot.scene import Scene

_USUAL = 99.5
"""Percentile of measured speeds, accelerations and jerks that counts as their limit: single rows may be wrong."""
_POSTURES = 400
"""Measured positions that are drawn from."""


@dataclass(frozen=True, slots=True)
class Space:
    """What a designed motion has to keep."""

    arm: Arm
    checker: CollisionChecker
    postures: Floats
    """[N, axes] rad: measured positions that are free of collisions and in the workspace."""
    home: Floats
    """[axes] rad: where every piece of motion begins and ends."""
    speed: Floats
    """[axes] rad/s."""
    acceleration: Floats
    """[axes] rad/s^2: as measured, and reached without more than the measured jerk."""
    workspace: tuple[float, ...] | None
    """x, y, z from, x, y, z to, m: box that the flange stays in; None: anywhere."""

    @classmethod
    def of(
        cls, arm: Arm, scene: Scene, segments: list[Segment], step_s: float, share: float,
        workspace: tuple[float, ...] | None,
    ) -> Space:  # fmt: skip
        """From measured motion; `share` of the robot's speed limits. Raises UserError where nothing remains."""
        robot = arm.description
        if not any(joint.capsules for joint in robot.joint):
            raise UserError(
                f"{robot.name}: the description has no capsules, so that collisions cannot be excluded; "
                "add capsules to the links (docs/robots.md)"
            )
        motions = [segment.motion(step_s) for segment in segments]
        rates = [(qd, qdd, np.diff(qdd, axis=0) / step_s) for _, qd, qdd in motions]
        speed, acceleration, jerk = (
            np.percentile(np.abs(np.concatenate([rate[k] for rate in rates])), _USUAL, axis=0) for k in range(3)
        )
        q = np.concatenate([segment.q for segment in segments])
        q = q[np.linspace(0, len(q) - 1, min(_POSTURES, len(q))).astype(int)]
        checker = CollisionChecker(arm, scene)
        inside = q[within(arm, q, workspace)]
        if not len(inside):
            raise UserError(
                f"none of {len(q)} measured positions of {robot.name} lies in the workspace; give two corners of "
                "a box around the flange, in m in the frame of the base"
            )
        free = inside[[not checker.collides(row) for row in inside]]
        if not len(free):
            raise UserError(
                f"{_most_touching(checker, inside)} collide in scene {scene.name} in all of {len(inside)} measured "
                f"positions of {robot.name}; move the boxes, in m in the frame of the base, or name another scene"
            )
        spread = np.maximum(np.ptp(free, axis=0), 1e-6)
        home = free[np.argmin((((free - np.median(free, axis=0)) / spread) ** 2).sum(axis=1))]
        still = speed < NOISE.stick_rad_s  # such a joint stays where it is, though other recordings have it elsewhere
        free = free[(np.abs(free - home)[:, still] <= NOISE.stick_rad_s * step_s).all(axis=1)]
        free[:, still] = home[still]
        return cls(
            arm, checker, free, home, np.minimum(share * robot.speed, speed),
            np.minimum(robot.acceleration, np.minimum(acceleration, jerk * SMOOTHING_S)), workspace,
        )  # fmt: skip

    @property
    def greatest_shares(self) -> tuple[float, float]:
        """Relative speed and acceleration that keep those of all joints that move."""
        robot, moves = self.arm.description, self.speed >= NOISE.stick_rad_s
        if not moves.any():
            return 0.0, 0.0
        return float((self.speed / robot.speed)[moves].min()), float(
            (self.acceleration / robot.acceleration)[moves].min()
        )

    @property
    def low(self) -> Floats:
        """[axes] rad: least measured positions within the limits."""
        return np.asarray(np.maximum(self.postures.min(axis=0), self.arm.description.lower))

    @property
    def high(self) -> Floats:
        """[axes] rad: greatest measured positions within the limits."""
        return np.asarray(np.minimum(self.postures.max(axis=0), self.arm.description.upper))

    def turning(self, least: float) -> list[int]:
        """Axes that have moved by more than `least` (rad or m): what the model knows of the others is a rest."""
        return [int(axis) for axis in np.flatnonzero((self.high - self.low > least) & (self.speed > 0))]

    def broken_limit(self, motion: Motion) -> str | None:
        """The first limit that a motion exceeds, in words; None: it keeps all of them."""
        return MotionLimits(self.arm, self.checker, self.speed, self.acceleration, self.workspace).broken(motion)


def _most_touching(checker: CollisionChecker, q: Floats) -> str:
    """The bodies that touch in most positions [N, axes]."""
    pairs = Counter(pair for row in q for pair in checker.touching(row))
    return " and ".join(pairs.most_common(1)[0][0])
