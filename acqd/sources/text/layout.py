"""Layouts of text exports: what stands above the table, and where the clock is. One data file per layout.

Most of a table shows itself: separator, decimal sign, names, units, time column (`table`). A layout adds what only the
maker knows: by which words the export is recognised, which line holds increment, start, names and units, and which
columns the table has where it is not the whole row. A user may add one of their own (`--layout FILE.toml`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path

from acqd.errors import InputError, UserError
from acqd.toml_file import tables_of

FOLDER = Path(__file__).with_name("layouts")
_TEXT = ("name", "title", "source", "advice", "times")


@dataclass(frozen=True, slots=True)
class Layout:
    """One layout. Keys are names of lines above the table, compared without case, spaces and punctuation."""

    name: str
    title: str
    source: str = ""
    """Document that the layout is made from."""
    recognise: tuple[str, ...] = ()
    """Regular expressions; each must match one of the first lines."""
    increment: tuple[str, ...] = ()
    """Keys of the time between two samples."""
    rate: tuple[str, ...] = ()
    """Keys of the sampling rate."""
    offset: tuple[str, ...] = ()
    """Keys of the time of the first sample [units of the increment]."""
    samples: tuple[str, ...] = ()
    """Keys of the number of rows."""
    date: tuple[str, ...] = ()
    """Keys of the date, or of date and time, of the first sample."""
    clock: tuple[str, ...] = ()
    """Keys of the time of day."""
    names: tuple[str, ...] = ()
    """Keys of the channels' names."""
    units: tuple[str, ...] = ()
    """Keys of the channels' units."""
    times: str = ""
    """Unit of the columns without a name, which are times."""
    inputs: tuple[str, ...] = ()
    """Regular expressions of names that stand for inputs of the instrument and say no phase."""
    columns: tuple[int, ...] = ()
    """Columns of the table, from 0; empty: all."""
    names_row: int | None = None
    """Row of the names, from 1, where it cannot be recognised."""
    first_row: int | None = None
    """First row of the table, from 1, where it cannot be recognised."""
    advice: str = ""
    """What to export instead, for files of this kind that cannot be metered."""


def known_layouts() -> list[str]:
    """Names of the layouts that come with acqd."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def find_layout(name: str) -> Layout:
    """A layout by its name, or by the path of a file. Raises UserError."""
    if name.endswith(".toml"):
        return _read(Path(name))
    if name not in known_layouts():
        raise UserError(
            f"--layout: there is no layout {name!r}; known are {', '.join(known_layouts())}, or give the path of a "
            ".toml file (docs/waveforms.md)"
        )
    return _read(FOLDER / f"{name}.toml")


def recognised(lines: list[str]) -> Layout:
    """The layout whose expressions match the first lines; the plain one where none does."""
    for name in known_layouts():
        layout = _read(FOLDER / f"{name}.toml")
        if layout.recognise and all(
            any(re.search(expression, line, re.IGNORECASE) for line in lines) for expression in layout.recognise
        ):
            return layout
    return _read(FOLDER / "plain.toml")


@lru_cache(maxsize=64)
def _read(path: Path) -> Layout:
    try:
        data = tables_of(path)
    except OSError as error:
        raise InputError(path, f"the layout cannot be read ({error.strerror})") from None
    known = {field.name for field in fields(Layout)}
    if unknown := [key for key in data if key not in known]:
        raise InputError(path, f"unknown key {unknown[0]}; a layout has {', '.join(sorted(known))}")
    values: dict[str, object] = {"name": path.stem, "title": path.stem}
    for key, value in data.items():
        number = key in ("names_row", "first_row")
        wanted = int if number else str if key in _TEXT else list
        inner = int if key == "columns" else str
        if not isinstance(value, wanted) or (isinstance(value, list) and not all(isinstance(v, inner) for v in value)):
            raise InputError(path, f"{key} is {value!r}; expected {'a number' if number else 'text or a list of it'}")
        values[key] = tuple(value) if isinstance(value, list) else value
    layout = Layout(**values)  # type: ignore[arg-type]
    for key, expression in (
        *(("recognise", one) for one in layout.recognise),
        *(("inputs", one) for one in layout.inputs),
    ):
        try:
            re.compile(expression)
        except re.error as error:
            raise InputError(path, f"{key}: {expression!r} is no regular expression ({error})") from None
    return layout


def key_of(text: str) -> str:
    """A key without case, spaces and punctuation."""
    return re.sub(r"[^a-z0-9]", "", text.lower())
