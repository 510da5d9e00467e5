"""The lines of a text export, from its first row to its last, without what stands below the table."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

from acqd.errors import InputError
from acqd.quoted_cells import rejoined
from acqd.sources.text.table import HEAD_LINES

_HEAD_BYTES = 1 << 20
_TAIL_BYTES = 8192
"""In which the lines below a table stand."""


class Text:
    """The lines of a file, read again by every method: never all of them in memory."""

    def __init__(self, path: Path, encoding: str) -> None:
        self.path, self._encoding = path, encoding
        self.torn = False
        """Whether the last line is left out: nobody ended it."""
        self.below: list[str] = []
        """Last lines that are left out: they stand below the table."""

    def ends_torn(self) -> bool:
        """Whether the last line has no end."""
        with self.path.open("rb") as file:
            wide = 2 if self._encoding.lower().startswith("utf-16") else 1
            file.seek(-wide, 2)
            return not self.below and file.read(wide).strip(b"\0") not in (b"\r", b"\n")

    def head(self) -> list[str]:
        """The first lines."""
        lines, size = [], 0
        for line in islice(self.lines(), HEAD_LINES):
            size += len(line)
            if size > _HEAD_BYTES:
                break
            lines.append(line)
        if not lines:
            raise InputError(self.path, "is empty")
        return lines

    def leave_out(self, is_row: Callable[[str], bool]) -> None:
        """Leave out the last lines that are no rows: results and remarks of an instrument below its table."""
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            file.seek(max(0, size - _TAIL_BYTES))
            tail = file.read()
        text = tail.decode(self._encoding.replace("utf-8-sig", "utf-8"), errors="replace")
        last = list(io.StringIO(text, newline=None))
        if size > _TAIL_BYTES:
            last = last[1:]  # cut off by the reading
        ends = [k for k, line in enumerate(last) if is_row(line)]
        below = last[ends[-1] + 1 :] if ends else []
        self.below = below if any(line.strip(" \t\r\n\0") for line in below) else []

    def lines(self) -> Iterator[str]:
        """All rows, each as one line. Raises InputError for bytes that are no text."""
        return (line for _, line in rejoined(self._lines_of_the_file()))

    def _lines_of_the_file(self) -> Iterator[str]:
        left_out = len(self.below) + self.torn
        try:
            with self.path.open(encoding=self._encoding) as file:
                last: deque[str] = deque()
                for line in file:
                    last.append(line)
                    if len(last) > left_out:
                        yield last.popleft()
        except UnicodeError:
            raise InputError(self.path, f"is not text in {self._encoding}; give its encoding with --encoding") from None
