"""What a sink remembers beside its database: how far it was, so that an older copy is noticed at the next start.

A database that is put back while the sink is stopped says nothing about it: the number of its last commit is smaller,
and nobody else knows that there was a greater one.
"""

from __future__ import annotations

import hashlib
import logging
import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import orjson

from acqd.atomic import private
from acqd.regular_file import read_regular

_log = logging.getLogger(__name__)
_EVERY_S = 1.0
_MOST_BYTES = 64 << 10
_MOST_DATABASES = 32
_LONGEST_NAME = 100


class DatabaseWitness:
    """Numbers of the last commits by identity of the database, in a file; for one thread."""

    def __init__(self, state_dir: Path | None, client_id: str, now: Callable[[], float] = time.monotonic) -> None:
        """Without `state_dir` nothing is remembered."""
        name = quote(client_id, safe="")
        if len(name) > _LONGEST_NAME:
            name = hashlib.sha256(name.encode()).hexdigest()
        self._path = None if state_dir is None else state_dir / f"sink-{name}.json"
        self._now, self._written_at, self._failed = now, -1e9, False
        self._numbers = self._read()

    def number(self, identity: str) -> int:
        """The last known commit in this database; 0: none is known."""
        return self._numbers.get(identity, 0)

    def committed(self, identity: str, number: int) -> None:
        """This commit is on the disk; written at most once a second, but a smaller number at once."""
        back = number < self._numbers.pop(identity, 0)
        self._numbers[identity] = number  # the last one used is the last to be forgotten
        if back or self._now() - self._written_at >= _EVERY_S:
            self.write()

    def write(self) -> None:
        """Replace the file. No disk is waited for: after a power cut an older number is as good as it was."""
        self._written_at = self._now()
        if self._path is None or not self._numbers:
            return
        while len(self._numbers) > _MOST_DATABASES:
            del self._numbers[next(iter(self._numbers))]
        temporary = self._path.with_name(f".{self._path.name}.new")
        try:
            with open(temporary, "wb", opener=private) as file:
                file.write(orjson.dumps(self._numbers))
            temporary.replace(self._path)
        except OSError as error:
            if not self._failed:
                _log.warning(
                    "%s: %s; a database that is put back while the sink is stopped will not be noticed",
                    self._path, error.strerror,
                )  # fmt: skip
            self._failed = True
        else:
            self._failed = False

    def _read(self) -> dict[str, int]:
        """The file; nothing where it is not there, or nobody can read it."""
        try:
            content = orjson.loads(read_regular(self._path, _MOST_BYTES)) if self._path is not None else {}
            return {str(name): int(number) for name, number in content.items() if 0 <= int(number) < 2**62}
        except (OSError, ValueError, TypeError, AttributeError):
            return {}
