"""TOML that people have written: where it cannot be read, the line and what belongs there."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from acqd.errors import InputError

_LARGEST = 4_000_000  # bytes: a fleet of ten thousand robots has less
_LINE = re.compile(r"\(at line (\d+), column \d+\)|\(at end of document\)")
_HEADER = re.compile(r"\s*(\[.*\])")
_PAIR = re.compile(r"\s*([^=#\[]+?)\s*=")
_TWICE = ("Cannot overwrite a value", "Cannot declare", "Cannot redefine", "Cannot mutate", "Duplicate")
_VALUE = "expected text in quotes, a number such as 0.5, true, false or a [list]"
_WORDS = (
    ("Invalid value", f"{{what}}: {_VALUE}"),
    ("Illegal character '\\n'", "{what}: the closing quote is missing"),
    ("Expected newline", "{what}: expected one value a line, numbers with a point and without a unit"),
    ("Invalid statement", "expected key = value, or [section]"),
    ("Expected '=' after a key", "expected key = value, or [section]"),
    ("Exceeds the limit", "a number has too many digits"),
    ("maximum recursion depth", "lists or tables are nested too deeply"),
)
"""How messages of tomllib begin, and what a person can do about them."""


def tables_of(path: Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises OSError where it cannot be opened, InputError for what is in it.

    No message repeats a value, which may be a password.
    """
    with path.open("rb") as file:
        content = file.read(_LARGEST + 1)
    if len(content) > _LARGEST:
        raise InputError(path, f"is larger than {_LARGEST // 1_000_000} MB; expected a file of TOML")
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        raise InputError(path, "cannot be read (no UTF-8 text); expected a file of TOML") from None
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: also numbers of more than 4300 digits
        raise InputError(path, f"is not valid TOML: {_mistake(str(error), text)}") from None


def _mistake(said: str, text: str) -> str:
    """What is wrong, with its line and its key."""
    lines = text.split("\n")
    place = _LINE.search(said)
    if place is None:
        return next((words for start, words in _WORDS if said.startswith(start)), said)
    number = int(place[1]) if place[1] else max((k for k, line in enumerate(lines, 1) if line.strip()), default=1)
    what = _what(lines[number - 1])
    if said.startswith(_TWICE):
        return f"line {number}: {what} is there already; leave one of the two"
    for start, words in _WORDS:
        if said.startswith(start):
            return f"line {number}: {words.format(what=what)}"
    return said


def _what(line: str) -> str:
    """The key or the header of a line, without its value."""
    found = _HEADER.match(line) or _PAIR.match(line)
    return found[1] if found else "a value"
