"""Contents of the log files in a folder: a log that was renamed differs from one that was written again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from acqd.sidecar.log_file import printable
from acqd.sidecar.log_folder import LogFolder, Mark, mark_of


class ChangedError(Exception):
    """A file has other content than when it was hashed."""


class Contents:
    """SHA-256 of every file that was read."""

    def __init__(self, folder: Path) -> None:
        self._folder = LogFolder(folder)
        self._files: dict[Path, tuple[str, Mark, str]] = {}

    def __contains__(self, path: Path) -> bool:
        return path in self._files

    def __getitem__(self, path: Path) -> str:
        return self._files[path][0]

    def read(self, path: Path) -> None:
        """Hashes a file; a file that cannot be read is forgotten. Raises OSError, InputError."""
        self._files.pop(path, None)
        self._files[path] = self._folder.identity(path)

    def refusal(self, path: Path) -> str:
        """Why a file is refused without reading it; empty if it may be read."""
        return self._files[path][2]

    @contextmanager
    def open(self, path: Path) -> Iterator[BinaryIO]:
        """The file with the content that was hashed. Raises OSError, InputError, ChangedError."""
        with self._folder.open(path) as file:
            if mark_of(file) != self._files[path][1]:
                raise ChangedError
            yield file

    def elsewhere(self, path: Path) -> Callable[[str], str | None]:
        """A function from a hash to the name of another file with this content, or None."""
        others = {identity[0]: other for other, identity in self._files.items() if other != path and other.exists()}
        return lambda sha256: self.name(others[sha256]) if sha256 in others else None

    def name(self, path: Path) -> str:
        """Path below the folder, as printable text."""
        return printable(path.relative_to(self._folder.folder).as_posix())
