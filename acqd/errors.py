"""Errors that a user can act on. Everything else is a bug and keeps its traceback."""

from __future__ import annotations


class UserError(Exception):
    """Bad input, configuration or environment.

    The message is one line: what is wrong, where (file, row, key), what was expected, what to do.
    Commands print it and exit with 2.
    """


class OperationError(Exception):
    """A failure that no other input or setting would have prevented. Its message is one line, the exit code 1."""


class InputError(UserError):
    """A file that cannot be used."""

    def __init__(self, path: object, problem: str) -> None:
        super().__init__(f"{path}: {problem}")

    def __reduce__(self) -> tuple[type[UserError], tuple[object, ...]]:
        """Pickled by its message: from a worker process it arrives as a UserError with the same line."""
        return UserError, self.args
