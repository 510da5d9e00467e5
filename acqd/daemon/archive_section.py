"""`[archive]` of acqd.toml: every sample, lossless, in a ring on disk."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from acqd.section import FileName, Section


class ArchiveSection(Section):
    """How much is kept, and where."""

    enabled: bool = False
    folder: FileName | None = None
    max_gb: Annotated[float, Field(ge=0.1, le=1_000_000)] = 100.0
    max_days: Annotated[float, Field(gt=0, le=36_500)] = 30.0
    keep_free_gb: Annotated[float, Field(ge=0, le=100_000)] = 2.0

    def place(self, state_dir: Path | None, device: str) -> Path | None:
        """Where the archive of a daemon is; None: nobody has said."""
        if self.folder is not None:
            return self.folder
        return state_dir / f"archive-{device}" if state_dir is not None else None
