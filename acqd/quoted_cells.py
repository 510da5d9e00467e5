"""Lines of a table whose quoted cells hold line breaks, as spreadsheets write them: a row becomes one line again."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

MOST_LINES = 10
"""Of a cell; a quote that no further line closes is a sign for inches, or a mistake."""
_SEPARATOR = r"[;,\t|]"
_WHOLE = re.compile(r'"(?:[^"]|"")*"')
_OPENS = re.compile(rf'(?:^|{_SEPARATOR})\s*"[^"]*$')
_CLOSES = re.compile(rf'(?:[^"]|"")*"\s*(?:{_SEPARATOR}|$)')


def rejoined(lines: Iterable[str]) -> Iterator[tuple[int, str]]:
    """Every row with the position of its first line; line breaks within a cell become spaces."""
    held: list[tuple[int, str]] = []
    for place, line in enumerate(lines):
        if not held and ('"' not in line or not ends_in_cell(line)):
            yield place, line
            continue
        held.append((place, line))
        if len(held) == 1:
            continue
        within = '"' not in line.replace('""', "")
        if not within and _CLOSES.match(line) and not ends_in_cell('"' + line):
            yield held[0][0], " ".join([*(part.rstrip("\r\n") for _, part in held[:-1]), line])
        elif not within or len(held) == MOST_LINES:
            yield from held
        else:
            continue
        held = []
    yield from held


def ends_in_cell(line: str) -> bool:
    """Whether a line ends within a quoted cell."""
    return _OPENS.search(_WHOLE.sub("", line)) is not None
