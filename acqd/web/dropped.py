"""Files of a visitor on their way to the disk: safe names, a limit of sizes, complete or not there."""

from __future__ import annotations

import asyncio
import re
import shutil
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path

from acqd.errors import UserError

MOST_FILES = 200
SILENT_S = 60.0
"""A visitor who sends nothing for so long has gone."""
_LEAST_RATE = 10_000.0
"""Bytes per second, after the first SILENT_S: one who sends byte by byte would keep all others out."""
_MOST_LETTERS = 120
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")
_SUFFIX = re.compile(r"\.[A-Za-z][A-Za-z0-9]{0,7}")


@dataclass(slots=True)
class Dropped:
    """Files in a folder of their own."""

    folder: Path
    most_bytes: int
    files: dict[str, int] = field(default_factory=dict)
    """Bytes of every file that is complete."""

    async def take(self, name: str, body: AsyncIterator[bytes]) -> str:
        """Store one file and return its name here. Raises UserError; nothing of a refused file stays."""
        name = self._free_name(name)
        left = self.most_bytes - sum(self.files.values())
        part, size = self.folder / f".{name}.part", 0
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with part.open("xb") as file:
                async for piece in _brisk(name, body):
                    size += len(piece)
                    if size > left:
                        raise UserError(f"{name}: more than {self.most_bytes / 1e6:.0f} MB in all; see [web] files_MB")
                    if piece and shutil.disk_usage(self.folder).free < self.most_bytes:
                        raise UserError(f"{name}: the disk of [web] reports is nearly full; free some of it")
                    file.write(piece)
            if not size:
                raise UserError(f"{name}: the file is empty")
            part.rename(self.folder / name)
        except OSError as error:
            raise UserError(f"{name}: cannot be stored ({error.strerror}); see [web] reports") from None
        finally:
            part.unlink(missing_ok=True)
        self.files[name] = size
        return name

    def _free_name(self, given: str) -> str:
        """The last part of a name without signs that mean something to a file system. Raises UserError.

        Readers go by the suffix: it is in small letters, and .csv where the name has no suffix.
        """
        name = _UNSAFE.sub("_", re.split(r"[/\\]", given)[-1]).lstrip(".-")[-_MOST_LETTERS:]
        if not name.strip("._-"):
            raise UserError(f"{given!r:.60}: a file needs a name of letters or digits")
        suffix = Path(name).suffix
        name = name.removesuffix(suffix) + suffix.lower() if _SUFFIX.fullmatch(suffix) else f"{name}.csv"
        if name in self.files:
            raise UserError(f"{name}: there is a file of this name already; rename one of them")
        if len(self.files) >= MOST_FILES:
            raise UserError(f"{name}: {MOST_FILES} files at a time at most")
        return name


async def _brisk(name: str, body: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    """The pieces of a body. Raises UserError when it comes too slowly, or stops."""
    begun, size = time.monotonic(), 0
    while True:
        try:
            async with asyncio.timeout(SILENT_S):  # wait_for of Python 3.11 may lose a cancellation beside a result
                piece = await anext(body, None)
        except TimeoutError:
            raise UserError(f"{name}: nothing has come for {SILENT_S:.0f} s; send the files again") from None
        if piece is None:
            return
        size += len(piece)
        if time.monotonic() - begun > SILENT_S + size / _LEAST_RATE:
            raise UserError(f"{name}: comes at less than {_LEAST_RATE / 1000:.0f} kB/s; use a faster network")
        yield piece
