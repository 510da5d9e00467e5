"""Errors that a user can act on. Everything else is a bug and keeps its traceback."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

_MOST, _TAIL = 2000, 300  # characters of a message, and of its end if its middle is left out


class _OneLine(Exception):  # noqa: N818
    """Its message is one line, whatever a file or the system has put into it."""

    def __init__(self, message: str = "") -> None:
        super().__init__(_one_line(str(message)))


class UserError(_OneLine):
    """Bad input, configuration or environment.

    The message is one line: what is wrong, where (file, row, key), what was expected, what to do.
    Commands print it and exit with 2. What a message repeats of a file cannot make it longer than that, nor reach a
    terminal as a control sequence.
    """


class SettingError(UserError):
    """A setting that no device can make right: trying again changes nothing."""


class OperationError(_OneLine):
    """A failure that no other input or setting would have prevented. Its message is one line, the exit code 1."""


class InputError(UserError):
    """A file that cannot be used."""

    def __init__(self, path: object, problem: str) -> None:
        super().__init__(f"{path}: {problem}")

    def __reduce__(self) -> tuple[type[UserError], tuple[object, ...]]:
        """Pickled by its message: from a worker process it arrives as a UserError with the same line."""
        return UserError, self.args


_SYSTEM = (
    (r":? cannot be read \(No such file or directory\)", ": no such file"),
    (r":? cannot be read \(Is a directory\)", ": is a folder, not a file"),
)
"""What the system says of a file, as this program says it: in every command the same."""


def _one_line(text: str) -> str:
    """Line ends and control characters as escapes, no numbers of the system, no middle if the text is long."""
    text = without_number(text)
    for pattern, words in _SYSTEM:
        text = re.sub(pattern, words, text)
    if len(text) > _MOST:
        text = f"{text[: _MOST - _TAIL]} [...] {text[-_TAIL:]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text.rstrip())


def place_in_file(keys: Sequence[int | str]) -> str:
    """A key of a TOML file in words, with tables and values counted from 1 as in other messages: step 3.speed."""
    place = ""
    for key in keys:
        place += f" {key + 1}" if isinstance(key, int) else f".{key}" if place else key
    return place


def without_number(error: object) -> str:
    """What an error of a library says, without the number that the system or a protocol has for the kind."""
    return re.sub(r"\[(errno |code:)-?\d+\] ", "", str(error), flags=re.IGNORECASE)


def no_folder(path: Path) -> str:
    """What is wrong where a folder was expected, and is not there."""
    return "is a file, not a folder" if path.exists() else "no such folder"


_PYDANTIC = (
    (r"^Value error, ", ""),
    (r"^Input is not a valid path\b.*", "expected a path in quotes"),
    (r"^Unable to parse input string as an integer, exceeded maximum size", "expected a smaller number"),
    (r"Input should be a valid integer", "expected a whole number"),
    (r"Input should be a valid dictionary( or instance of \w+)?", "expected a table of keys and values"),
    (r"Input should be a valid (\w+)", r"expected a \1"),
    (r"Input should be (greater|less) ", r"expected a number \1 "),
    (r"Input should be ", "expected "),
    (r"^\w+ should have (at (?:least|most) \d+ \w+)(?: after validation)?", r"expected \1"),
    (r"^Extra inputs are not permitted$", "there is no such key; is it misspelt?"),
    (r"^Field required$", "is missing"),
    (r", unable to parse string as .*$", ""),
)


def in_our_words(complaint: str) -> str:
    """What Pydantic says of a value, as this program says it."""
    for pattern, replacement in _PYDANTIC:
        complaint = re.sub(pattern, replacement, complaint)
    return complaint
