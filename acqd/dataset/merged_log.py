"""Logs with their places in the power stream and the recordings that were merged from them."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.dataset.merge import Recording
from acqd.dataset.placement import Alignment, Placement
from acqd.dataset.power import PowerStream
from acqd.robot.log import RobotLog


@dataclass(frozen=True, slots=True)
class MergedLog:
    """A log that was merged, or refused."""

    log: RobotLog
    placement: Placement
    recording: Recording | None
    reason: str = ""
    """Why the recording is missing."""


@dataclass(frozen=True, slots=True)
class Batch:
    """All that one build merged."""

    powers: list[PowerStream]
    """The stream of all logs, or one for each log."""
    alignment: Alignment
    merged: list[MergedLog]
    refused: list[str]
    """Logs that were refused before the alignment."""
    notes: list[str]
    known: int = 0
    """Logs that the dataset held already."""
