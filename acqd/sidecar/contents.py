"""Contents of the log files in a folder: a log that was renamed differs from one that was written again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from acqd.sidecar.log_file import hash_of, printable


class Contents:
    """SHA-256 of every file that was read."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._hashes: dict[Path, str] = {}

    def __contains__(self, path: Path) -> bool:
        return path in self._hashes

    def __getitem__(self, path: Path) -> str:
        return self._hashes[path]

    def read(self, path: Path) -> None:
        """Hashes a file; a file that cannot be read is forgotten. Raises OSError."""
        self._hashes.pop(path, None)
        self._hashes[path] = hash_of(path)

    def elsewhere(self, path: Path) -> Callable[[str], str | None]:
        """A function from a hash to the name of another file with this content, or None."""
        others = {sha256: other for other, sha256 in self._hashes.items() if other != path and other.exists()}
        return lambda sha256: self.name(others[sha256]) if sha256 in others else None

    def name(self, path: Path) -> str:
        """Path below the folder, as printable text."""
        return printable(path.relative_to(self._folder).as_posix())
