"""The folders of a campaign: what an analyst may read, and the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from acqd.atomic import naming


@dataclass(frozen=True, slots=True)
class Folders:
    """Where a campaign keeps its files."""

    out: Path
    """Public: logs, trajectories, manifest, database."""
    truth: Path
    """Secret: an analyst must not read it."""

    def logs(self, device: str) -> Path:
        """Robot logs of one cell."""
        return self.out / "logs" / device

    def twin(self, device: str) -> Path:
        """Motions of one cell's digital twin."""
        return self.out / "twin" / device

    @property
    def trajectories(self) -> Path:
        """Source trajectories."""
        return self.out / "trajectories"

    @property
    def work(self) -> Path:
        """Reports of finished sessions, and their rows until the database has them."""
        return self.truth / "work"


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write JSON under a temporary name and rename it: a reader never sees half a file."""
    temporary = path.with_suffix(".part")
    with naming(path):
        temporary.write_bytes(orjson.dumps(content, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY))
        temporary.replace(path)
