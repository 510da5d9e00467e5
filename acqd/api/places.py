"""Arguments that name a file or a folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypeAlias

Place: TypeAlias = str | os.PathLike[str]
"""A file or folder."""


def path_of(place: Place) -> Path:
    """The place as a path; `~` is the home folder."""
    return Path(place).expanduser()
