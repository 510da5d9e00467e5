"""Files of a visitor on their way to the disk: safe names, a limit of sizes, complete or not there."""

from __future__ import annotations

import re
import shutil
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path

from acqd.errors import UserError

MOST_FILES = 200
_MOST_LETTERS = 120
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


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
                async for piece in body:
                    size += len(piece)
                    if size > left:
                        raise UserError(f"{name}: more than {self.most_bytes / 1e6:.0f} MB in all; see [web] files_MB")
                    if size % (1 << 24) < len(piece) and shutil.disk_usage(self.folder).free < self.most_bytes:
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
        """The last part of a name without signs that mean something to a file system. Raises UserError."""
        name = _UNSAFE.sub("_", re.split(r"[/\\]", given)[-1]).lstrip(".-")[-_MOST_LETTERS:]
        if not name.strip("._-"):
            raise UserError(f"{given!r:.60}: a file needs a name of letters or digits")
        if name in self.files:
            raise UserError(f"{name}: there is a file of this name already; rename one of them")
        if len(self.files) >= MOST_FILES:
            raise UserError(f"{name}: {MOST_FILES} files at a time at most")
        return name
