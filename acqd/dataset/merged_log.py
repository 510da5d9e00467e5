"""One log with its place in the power stream and the recording that was merged from it."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.dataset.merge import Recording
from acqd.dataset.placement import Placement
from acqd.robot.log import RobotLog


@dataclass(frozen=True, slots=True)
class MergedLog:
    """A log that was merged, or refused."""

    log: RobotLog
    placement: Placement
    recording: Recording | None
    reason: str = ""
    """Why the recording is missing."""
