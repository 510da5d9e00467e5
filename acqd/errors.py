"""Errors that a user can act on. Everything else is a bug and keeps its traceback."""

from __future__ import annotations

import re

_MOST, _TAIL = 2000, 300  # characters of a message, and of its end if its middle is left out


class UserError(Exception):
    """Bad input, configuration or environment.

    The message is one line: what is wrong, where (file, row, key), what was expected, what to do.
    Commands print it and exit with 2. What a message repeats of a file cannot make it longer than that, nor reach a
    terminal as a control sequence.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(_one_line(str(message)))


class SettingError(UserError):
    """A setting that no device can make right: trying again changes nothing."""


class OperationError(Exception):
    """A failure that no other input or setting would have prevented. Its message is one line, the exit code 1."""


class InputError(UserError):
    """A file that cannot be used."""

    def __init__(self, path: object, problem: str) -> None:
        super().__init__(f"{path}: {problem}")

    def __reduce__(self) -> tuple[type[UserError], tuple[object, ...]]:
        """Pickled by its message: from a worker process it arrives as a UserError with the same line."""
        return UserError, self.args


def _one_line(text: str) -> str:
    """The text with line ends and control characters as escapes, and without its middle if it is long."""
    if len(text) > _MOST:
        text = f"{text[: _MOST - _TAIL]} [...] {text[-_TAIL:]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text.rstrip())


def without_number(error: object) -> str:
    """What an error of a library says, without the number that the system has for the kind."""
    return re.sub(r"\[Errno -?\d+\] ", "", str(error))
