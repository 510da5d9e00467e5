"""Finds log files that have arrived whole: nothing writes to them any more, and their last line is complete."""

from __future__ import annotations

import logging
import os
import stat
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from acqd.errors import InputError
from acqd.sidecar.log_file import printable
from acqd.sidecar.log_folder import LogFolder

_log = logging.getLogger(__name__)
_SUFFIXES = (".log", ".csv", ".txt")
_INCOMPLETE_S = 30.0
"""A file that is empty or ends within a line is taken after this time without a change."""


@dataclass(slots=True)
class Arrivals:
    """Plain files of one folder; a file is whole after `settle_s` without a change. Links are left out."""

    folder: Path
    settle_s: float = 0.5
    _seen: dict[Path, tuple[int, int, float]] = field(default_factory=dict)
    """Size, mtime in ns, and since when (monotonic) both are unchanged."""
    _yielded: dict[Path, tuple[int, int]] = field(default_factory=dict)
    _links: set[Path] = field(default_factory=set)
    """That were reported."""

    def look(self) -> Iterator[Path]:
        """Files that have become whole since the last look, in the order of their names; each content once."""
        now = time.monotonic()
        for path in sorted(self.folder.rglob("*")):
            if path.suffix.lower() not in _SUFFIXES or path.name.startswith((".", "~")):
                continue
            try:
                status = path.lstat()
            except OSError:
                continue  # it was removed meanwhile
            if not stat.S_ISREG(status.st_mode):  # a folder with such a name, a pipe, a link
                self._report_link(path, status)
                continue
            mark = (status.st_size, status.st_mtime_ns)
            if self._yielded.get(path) == mark:
                continue
            seen = self._seen.get(path)
            if seen is None or seen[:2] != mark:
                age = time.time() - status.st_mtime  # an old file needs no waiting
                self._seen[path] = (*mark, now - max(0.0, min(age, _INCOMPLETE_S)))
                seen = self._seen[path]
            if now - seen[2] < (self.settle_s if self._ends_with_newline(path) else _INCOMPLETE_S):
                continue
            self._yielded[path] = mark
            yield path

    def forget(self, path: Path) -> None:
        """Yields a file once more, which could not be read or stored."""
        self._yielded.pop(path, None)

    def waiting(self) -> bool:
        """Whether a file is still being written."""
        return any(self._yielded.get(path) != mark[:2] for path, mark in self._seen.items() if path.exists())

    def _report_link(self, path: Path, status: os.stat_result) -> None:
        if stat.S_ISLNK(status.st_mode) and path not in self._links:
            self._links.add(path)
            _log.warning("%s: is a link and left out; copy the log itself into the folder", printable(path.name))

    def _ends_with_newline(self, path: Path) -> bool:
        try:
            with LogFolder(self.folder).open(path) as file:
                file.seek(-1, os.SEEK_END)
                return file.read(1) == b"\n"
        except (OSError, InputError):
            return False
