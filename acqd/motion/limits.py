"""What a motion has to keep: positions, speeds, accelerations, jerk, torques, a workspace, and no collision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.motion.controller import RATE, Motion
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker
from acqd.robot.dynamics import inverse_dynamics
from acqd.robot.kinematics import forward_kinematics

_CHECK_S = 0.02
"""Between two configurations that are checked: at 1 m/s 2 cm, less than the radius of a capsule."""
_CONTROL = 8
"""Rows of a controller's step, 8 ms: what is shorter its interpolation smooths."""
_SLACK = 1 + 1e-6


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of one arm in one scene."""

    arm: Arm
    checker: CollisionChecker
    speed: Floats
    """[axes] rad/s."""
    acceleration: Floats
    """[axes] rad/s^2."""
    workspace: tuple[float, ...] | None = None
    """x, y, z from, x, y, z to, m: box that the flange stays in; None: anywhere."""
    jerk: Floats | None = None
    """[axes] rad/s^3; None: any."""

    def broken(self, motion: Motion) -> str | None:
        """The first limit that a motion exceeds, in words; None: it keeps all of them.

        Torques are those of the described arm without a payload.
        """
        robot = self.arm.description
        rows = slice(None, None, int(_CHECK_S * RATE))
        q, qd, qdd = motion.q[rows], motion.qd[rows], motion.qdd[rows]
        torque = inverse_dynamics(self.arm, q, qd, qdd)
        jerk = greatest_jerk(motion)
        for axis, joint in enumerate(robot.joint):
            values = {
                "position": max(
                    motion.q[:, axis].max() - robot.upper[axis], robot.lower[axis] - motion.q[:, axis].min()
                )
                <= 1e-9,
                "speed": np.abs(motion.qd[:, axis]).max() <= self.speed[axis] * _SLACK,
                "acceleration": np.abs(motion.qdd[:, axis]).max() <= self.acceleration[axis] * _SLACK,
                "jerk": self.jerk is None or jerk[axis] <= self.jerk[axis] * _SLACK,
                "torque": np.abs(torque[:, axis]).max() <= robot.effort[axis] * _SLACK,
            }
            for what, kept in values.items():
                if not kept:
                    return f"{what} of {joint.name}"
        if not within(self.arm, q, self.workspace).all():
            return "workspace"
        return "collision" if self.checker.path_collides(q) else None


def greatest_jerk(motion: Motion) -> Floats:
    """[axes] rad/s^3, over the steps of a robot's controller."""
    return np.asarray(np.abs(motion.qdd[_CONTROL:] - motion.qdd[:-_CONTROL]).max(axis=0, initial=0.0) * RATE / _CONTROL)


def within(arm: Arm, q: Floats, box: tuple[float, ...] | None) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """[T] whether the flange is in a box."""
    if box is None:
        return np.ones(len(q), dtype=bool)
    position, _ = forward_kinematics(arm, q)
    return np.asarray(((position >= box[:3]) & (position <= box[3:])).all(axis=1))
