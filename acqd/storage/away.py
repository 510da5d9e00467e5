"""A database that cannot be used now, or says that it has what it has not."""

from __future__ import annotations

import sqlalchemy as sa

from acqd.errors import UserError
from acqd.storage.url import shown


class DatabaseAwayError(UserError):
    """The database cannot be used now; trying again may help."""

    def __init__(self, message: str, reason: str) -> None:
        """`reason`: what the database or its driver says, in one line."""
        super().__init__(message)
        self.reason = reason


class LeftOutError(DatabaseAwayError):
    """The database reports success and has not taken all rows."""


def left_out(connection: sa.Connection, rows: int | None = None) -> LeftOutError:
    """What to raise where the database reports success and has not taken all rows: they get no receipt.

    `rows`: how many; None where nobody knows.
    """
    number = "" if rows is None else f" ({rows})"
    text = f"{shown(connection.engine.url)}: it leaves out rows{number} without an error"
    text += ": does a trigger, a rule or a policy of the table drop them?"
    return LeftOutError(f"database {text}", text)
