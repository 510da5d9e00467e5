"""The schedule of a campaign: its recordings and their sessions, decided before anything runs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from acqd.lab.cell import ORDER
from acqd.lab.settings import CampaignSettings, LabSettings

_LONGEST_S = 240.0  # longest recording at the speeds of the thesis
_BETWEEN_S = 900.0  # margin that keeps sessions from overlapping


@dataclass(frozen=True, slots=True)
class RecordingPlan:
    """One execution of a source trajectory or of the assembly."""

    number: int
    """In its cell's campaign, from 1."""
    space: str
    """limited, all or assembly."""
    source: int
    """Number of the source trajectory, from 1; 0 for an assembly."""

    @property
    def source_name(self) -> str:
        """Name of the source trajectory."""
        return f"{self.space}_{self.source:02d}" if self.source else self.space

    @property
    def name(self) -> str:
        """Name of the log, without its ending."""
        return f"{self.source_name}_{self.number:04d}"


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """The executions in one uninterrupted power stream."""

    cell: int
    number: int
    """Within the cell, from 0."""
    start_s: float
    """Since the start of the campaign."""
    recordings: tuple[RecordingPlan, ...]

    @property
    def name(self) -> str:
        """Name of the session's files, without their endings."""
        return f"cell{self.cell + 1:02d}-session{self.number + 1:03d}"

    def boot(self, settings: CampaignSettings) -> str:
        """Boot identifier in power rows; it differs between campaigns, which may share a database."""
        digest = hashlib.blake2b(settings.model_dump_json().encode(), digest_size=5).hexdigest()
        return f"{digest}-{self.cell + 1}-{self.number + 1}"


def plan_sessions(settings: CampaignSettings) -> list[SessionPlan]:
    """All sessions of all cells. Recordings in limited space come before those in all space, as in the thesis."""
    sessions = []
    for cell in range(settings.cells):
        recordings = _recordings(settings, cell)
        start_s = 0.0
        for number, first in enumerate(range(0, len(recordings), settings.session)):
            part = tuple(recordings[first : first + settings.session])
            sessions.append(SessionPlan(cell, number, start_s, part))
            start_s += reserved_s(settings, len(part))
    return sessions


def reserved_s(settings: CampaignSettings, recordings: int) -> float:
    """Time (s) from the start of a session with that many recordings to the start of the next session."""
    motion = settings.motion
    slowdown = max(1.0, 0.2 / motion.relative_speed[0], float(np.sqrt(0.2 / motion.relative_acceleration)))
    return recordings * (_LONGEST_S * slowdown + settings.pause_s) + _BETWEEN_S


def session_start_s(settings: LabSettings, recording: int) -> float:
    """Start (s since the start of the campaign) of the session with `recording`; 0 for a single execution."""
    if not isinstance(settings, CampaignSettings):
        return 0.0
    return (recording - 1) // settings.session * reserved_s(settings, settings.session)


def _recordings(settings: CampaignSettings, cell: int) -> list[RecordingPlan]:
    """Recordings of a cell; every source trajectory is used equally often, in random order."""
    if settings.profile == "use-case":
        return [RecordingPlan(number, "assembly", 0) for number in range(1, settings.assemblies + 1)]
    random = settings.random(cell, ORDER)
    chosen: list[tuple[str, int]] = []
    for space, count, sources in (
        ("limited", settings.limited, settings.limited_sources),
        ("all", settings.all_space, settings.all_space_sources),
    ):
        turns = [1 + k % sources for k in range(count)]
        chosen += [(space, int(source)) for source in random.permutation(turns)]
    return [RecordingPlan(number, *source) for number, source in enumerate(chosen, start=1)]
