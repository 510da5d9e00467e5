"""Which recordings a campaign has, and in which sessions: decided before anything runs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from acqd.lab.cell import ORDER
from acqd.lab.settings import CampaignSettings

_LONGEST_S = 240.0  # that a recording with its pause may take: keeps sessions apart in time
_BETWEEN_S = 900.0


@dataclass(frozen=True, slots=True)
class RecordingPlan:
    """One execution."""

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
    """Executions in one power stream."""

    cell: int
    number: int
    """Within the cell, from 0."""
    start_s: float
    """After the campaign's begin."""
    recordings: tuple[RecordingPlan, ...]

    @property
    def name(self) -> str:
        """For files."""
        return f"cell{self.cell + 1:02d}-session{self.number + 1:03d}"

    def boot(self, settings: CampaignSettings) -> str:
        """For rows: other campaigns may lie in the same database, and theirs must differ."""
        digest = hashlib.blake2b(settings.model_dump_json().encode(), digest_size=5).hexdigest()
        return f"{digest}-{self.cell + 1}-{self.number + 1}"


def plan_sessions(settings: CampaignSettings) -> list[SessionPlan]:
    """All sessions of all cells. Sources take turns; limited space comes before all space, as in the thesis."""
    sessions = []
    for cell in range(settings.cells):
        recordings = _recordings(settings, cell)
        start = 0.0
        for number, first in enumerate(range(0, len(recordings), settings.session)):
            part = tuple(recordings[first : first + settings.session])
            sessions.append(SessionPlan(cell, number, start, part))
            start += len(part) * (_LONGEST_S + settings.pause_s) + _BETWEEN_S
    return sessions


def _recordings(settings: CampaignSettings, cell: int) -> list[RecordingPlan]:
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
