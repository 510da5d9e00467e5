"""The arm that the page draws: the chain of a robot description, and the positions of its joints as they come."""

from __future__ import annotations

import math
import time

import orjson

from acqd.errors import UserError
from acqd.report.palette import CAUSES
from acqd.robot.description import load_description
from acqd.robot.frames import frames_of

_MOST_JOINTS = 16
_FARTHEST_S = 3600.0
_OTHER_CLOCK = (
    "acqd/DEVICE/joints: expected time as Unix s of the meter's clock, to within 1 h of this computer's; a message "
    "without a time is of now"
)


class Posture:
    """One robot; without a description that can be read, `note` says why there is no arm."""

    def __init__(self, robot: str) -> None:
        """`robot`: a shipped description, a path, or nothing."""
        self.robot, self.note = robot, ""
        self._frames: dict[str, object] | None = None
        self._axes = 0
        try:
            if robot:
                description = load_description(robot)
                self._frames, self._axes = frames_of(description), description.axes
        except UserError as error:
            self.note = str(error)

    def as_json(self) -> dict[str, object]:
        """For the page: the chain (see `acqd.robot.frames`), and the colours of causes."""
        return {"robot": self.robot, "note": self.note, "frames": self._frames, "colours": CAUSES}

    def joints(self, payload: bytes) -> dict[str, object] | None:
        """Time [Unix s] and positions [rad or m] of a message of acqd/DEVICE/joints; None where they are unusable.

        A message without a time is of now. Where its time is of another clock or unit, `note` says so.
        """
        try:
            message = orjson.loads(payload)
            time_s, q = float(message.get("time", time.time())), [float(angle) for angle in message["q"][:_MOST_JOINTS]]
        except (orjson.JSONDecodeError, AttributeError, KeyError, TypeError, ValueError):
            return None
        if not self._axes or len(q) != self._axes or not all(map(math.isfinite, (time_s, *q))):
            return None
        far = abs(time_s - time.time()) > _FARTHEST_S
        if far or self.note == _OTHER_CLOCK:
            self.note = _OTHER_CLOCK if far else ""
        return None if far else {"time": time_s, "q": [round(angle, 4) for angle in q]}
