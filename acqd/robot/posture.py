"""Frames of an arm at one configuration, for drawings and lengths, in plain numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription
from acqd.robot.newton_euler import Chain, frames


@dataclass(frozen=True, slots=True)
class Posture:
    """Where base and joints are, in the base frame."""

    origin: Floats
    """[axes + 1, 3] m: the base, then the joints."""
    rotation: Floats
    """[axes + 1, 3, 3]."""
    flange: Floats
    """[3] m."""

    @classmethod
    def of(cls, robot: RobotDescription, q: Floats) -> Posture:
        """The posture at joint positions `q` [axes] (rad or m)."""
        chain = Chain.of(robot)
        moved = frames(chain, np.asarray(q, dtype=np.float64)[None])
        origin, rotation = moved.origin[0], moved.rotation[0]
        flange = origin[-1] + rotation[-1] @ chain.tip[0]
        return cls(np.vstack([np.zeros((1, 3)), origin]), np.concatenate([np.eye(3)[None], rotation]), flange)

    @property
    def points(self) -> Floats:
        """Positions [axes + 2, 3] (m) of base, joints and flange."""
        return np.vstack([self.origin, self.flange])

    def placed(self, body: int, point: tuple[float, float, float]) -> Floats:
        """A point [3] of the frame of `body` (0: the base, 1: the first joint's link, ...) in the base frame, m."""
        return np.asarray(self.origin[body] + self.rotation[body] @ np.array(point))
