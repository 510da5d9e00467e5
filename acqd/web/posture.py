"""The arm's posture: positions of the joints for a small drawing."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
import orjson

from acqd.errors import UserError
from acqd.robot.description import load_description

_MOST_JOINTS = 16


class Posture:
    """Kinematics of one robot; without pinocchio or a robot, `note` says why there is no drawing."""

    def __init__(self, robot: str) -> None:
        """`robot`: a shipped description, a path, or nothing."""
        self.robot, self.note = robot, ""
        self._arm: Any = None
        if not robot:
            self.note = "no robot: set robot in [web]"
        elif find_spec("pinocchio") is None:
            self.note = "drawing the arm needs pinocchio: pip install 'acqd[loop]'"
        else:
            try:
                from acqd.robot.arm import Arm

                self._arm = Arm(load_description(robot))
            except UserError as error:
                self.note = str(error)

    def points(self, payload: bytes) -> list[list[float]] | None:
        """Positions [m] of base, joints and flange of a message of acqd/DEVICE/joints; None when it has no usable q."""
        if self._arm is None:
            return None
        try:
            q = np.array([float(angle) for angle in orjson.loads(payload)["q"][:_MOST_JOINTS]])
        except (orjson.JSONDecodeError, KeyError, TypeError, ValueError):
            return None
        if q.shape != (self._arm.axes,) or not np.isfinite(q).all():
            return None
        from acqd.robot.kinematics import joint_origins

        return np.round(joint_origins(self._arm, q), 4).tolist()  # type: ignore[no-any-return]
