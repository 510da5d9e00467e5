"""What a report is made of. `kind` is the name by which assets/page.html knows a block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from acqd.report.arm_view import ArmView
from acqd.report.bars import Bars
from acqd.report.digits import number
from acqd.report.lines import Chart

_SHORT = 18
"""Characters of a cell that need no line break."""
_PHONE, _TEXT = 38, 105
"""Characters of a row of a table beside each other on a phone of 390 px, and in the width of the text."""
_GAP = 3
"""Between two columns, in characters."""
_NARROW = 24
"""Characters that the least width of a column of sentences (`.words`, 12rem) holds in one line."""


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"
    text: str


@dataclass(frozen=True, slots=True)
class Link:
    """A cell that leads to another page."""

    text: str
    href: str
    """Relative to the page, as a URL."""


@dataclass(frozen=True, slots=True)
class Spark:
    """A cell with a course as a small line, and the course in words for those who cannot see it."""

    text: str
    values: tuple[float | None, ...]
    """None interrupts the line."""
    alt: str

    @property
    def path(self) -> str:
        """SVG path in a box of 60 x 16, from zero to the largest value."""
        most = max((value for value in self.values if value is not None), default=0.0) or 1.0
        step = 60 / max(len(self.values) - 1, 1)
        parts, pen = [], "M"
        for k, value in enumerate(self.values):
            if value is None:
                pen = "M"
                continue
            parts.append(f"{pen}{step * k:.1f} {15 - 14 * max(value, 0.0) / most:.1f}")
            pen = "L"
        return "".join(parts)


Cell = str | Link | Spark


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text; columns of words are aligned to the left."""

    kind: ClassVar[str] = "table"
    label: str
    header: list[str]
    rows: list[list[Cell]]
    classes: list[str]
    """Of the style sheet, per column: words (sentences), text (to the left), short (no line breaks)."""
    sortable: bool = False
    """The script adds buttons that sort by a column, and a field that filters rows."""

    @property
    def stacked(self) -> bool:
        """Whether a phone shows the cells of a row one below the other, each with the name of its column."""
        return self._least_width(_NARROW // 2) > _PHONE

    @property
    def wide(self) -> bool:
        """Whether the table needs more room than lines of text."""
        return self._least_width(_NARROW) > _TEXT

    def _least_width(self, words: int) -> int:
        """Characters of a row whose lines break as often as they may; `words`: of a column of sentences."""
        columns = zip(*([self.header, *self.rows]), strict=True)
        return sum(_least_width(column, kind, words) for column, kind in zip(columns, self.classes, strict=True))


@dataclass(frozen=True, slots=True)
class Lines:
    """A chart of lines."""

    kind: ClassVar[str] = "chart"
    chart: Chart
    caption: str


@dataclass(frozen=True, slots=True)
class Ranking:
    """A chart of bars."""

    kind: ClassVar[str] = "bars"
    bars: Bars
    caption: str


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawing as SVG."""

    kind: ClassVar[str] = "picture"
    svg: str
    label: str
    caption: str


@dataclass(frozen=True, slots=True)
class Chapter:
    """The body of another report, folded."""

    kind: ClassVar[str] = "chapter"
    title: str
    html: str


@dataclass(slots=True)
class Folded:
    """Blocks behind a title that opens them."""

    kind: ClassVar[str] = "folded"
    title: str
    blocks: list[Block] = field(default_factory=list)


Block = Text | Table | Lines | Ranking | Picture | ArmView | Chapter | Folded


@dataclass(slots=True)
class Section:
    """A heading with what follows it."""

    title: str
    anchor: str
    blocks: list[Block] = field(default_factory=list)


def table_of(label: str, header: Sequence[str], rows: Sequence[Sequence[object]], *, sortable: bool = False) -> Table:
    """A table of any cells; floats are shown to four significant digits at most."""
    texts = [[_cell(cell) for cell in row] for row in rows]
    plain = [[cell.text if isinstance(cell, (Link, Spark)) else cell for cell in row] for row in rows]
    columns = [[row[column] for row in plain] for column in range(len(header))]
    return Table(label, list(header), texts, [_of_names(columns[0]), *map(_classes, columns[1:])], sortable)


def _least_width(column: Sequence[Cell], kind: str, words: int) -> int:
    """Characters that a column with these classes takes at least, with the gap to the next one."""
    header, *cells = [cell if isinstance(cell, str) else cell.text for cell in column]
    pieces = cells if "short" in kind else [word for cell in cells for word in cell.split()]
    course = 8 if any(isinstance(cell, Spark) for cell in column) else 0
    longest = max(map(len, [*header.split(), *pieces]), default=0)
    return max(longest + course, words if "words" in kind else 0) + _GAP


def _of_names(column: Sequence[object]) -> str:
    """Class of the first column: names such as hall-3-press-01 stay in one line."""
    return "short" if all(" " not in str(cell) and len(str(cell)) <= _SHORT for cell in column) else ""


def _classes(column: Sequence[object]) -> str:
    """Classes of a column's cells."""
    texts = [cell for cell in column if isinstance(cell, str) and cell]
    if any(map(_is_prose, texts)):
        return "words"
    if not texts:
        return ""
    named = ["text"] if all(text[0].isalpha() for text in texts) else []
    return " ".join([*named, "short"] if all(len(text) <= _SHORT for text in texts) else named)


def _is_prose(cell: object) -> bool:
    """Several words with hardly a digit, longer than the least width of a column of sentences."""
    text = str(cell)
    return (
        len(text) > _NARROW and text.count(" ") >= 2 and sum(character.isdigit() for character in text) < len(text) / 4
    )


def _cell(value: object) -> Cell:
    if isinstance(value, (Link, Spark)):
        return value
    return number(value, 3) if isinstance(value, float) else str(value)
