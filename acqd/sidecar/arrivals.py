"""Files that have arrived whole: nothing is written to them any more, and their last line is complete."""

from __future__ import annotations

import stat
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

_SUFFIXES = (".log", ".csv", ".txt")
_UNENDED_S = 30.0
"""A file that ends within a line, or is empty, is taken when nothing has come for so long."""


@dataclass(slots=True)
class Arrivals:
    """Looks at a folder; `settle_s` without a change make a file whole."""

    folder: Path
    settle_s: float = 0.5
    _seen: dict[Path, tuple[int, int, float]] = field(default_factory=dict)
    """Size, mtime in ns, and since when (monotonic) they are so."""
    _given: dict[Path, tuple[int, int]] = field(default_factory=dict)

    def look(self) -> Iterator[Path]:
        """Files that have become whole since the last look, each content once; in the order of their names."""
        now = time.monotonic()
        for path in sorted(self.folder.rglob("*")):
            if path.suffix.lower() not in _SUFFIXES or path.name.startswith((".", "~")):
                continue
            try:
                status = path.stat()
            except OSError:
                continue  # gone again
            if not stat.S_ISREG(status.st_mode):
                continue  # a folder that is called so, a pipe that nobody writes to
            mark = (status.st_size, status.st_mtime_ns)
            if self._given.get(path) == mark:
                continue
            seen = self._seen.get(path)
            if seen is None or seen[:2] != mark:
                age = time.time() - status.st_mtime  # an old file need not be waited for
                self._seen[path] = (*mark, now - max(0.0, min(age, _UNENDED_S)))
                seen = self._seen[path]
            if now - seen[2] < (self.settle_s if _ended(path) else _UNENDED_S):
                continue
            self._given[path] = mark
            yield path

    def forget(self, path: Path) -> None:
        """Look at a file again that could not be taken."""
        self._given.pop(path, None)

    def waiting(self) -> bool:
        """Whether a file is still being written."""
        return any(self._given.get(path) != mark[:2] for path, mark in self._seen.items() if path.exists())


def _ended(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            file.seek(-1, 2)
            return file.read(1) == b"\n"
    except OSError:
        return False
