"""Which errors of a database pass by themselves, and which need a person."""

from __future__ import annotations

import sqlite3
from typing import Any

import sqlalchemy as sa

_SQLITE = {sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_NOMEM, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_FULL}
OUTAGES = ("08", "25", "40", "53", "55", "57", "58")
"""SQLSTATE: connection, read-only (a failover is under way), rollback, resources, locks, operator, system
(PostgreSQL documentation, appendix A)."""
_FOR_A_PERSON = ("pg_hba.conf", "authentication failed", "does not exist", "permission denied", "invalid ")
_BUSY = ("slots", "too many")


def is_outage(error: sa.exc.DBAPIError) -> bool:
    """Whether trying again may help: the server is away, starts, is locked or full.

    An unknown host name counts as an outage, because nobody can tell a mistyped name from a name server that is away.
    """
    cause: Any = error.orig
    if isinstance(cause, sqlite3.Error):
        return getattr(cause, "sqlite_errorcode", 0) & 0xFF in _SQLITE
    if not isinstance(error, sa.exc.OperationalError | sa.exc.InternalError):
        return False
    state = getattr(cause, "sqlstate", None)
    return state.startswith(OUTAGES) if state else not _refused(cause)


def _refused(cause: Any) -> bool:
    """Whether the server, or the driver, has refused a connection for what it was asked for.

    libpq returns no SQLSTATE here, and a server may speak any language: whether it has asked for a password says more
    than the text. A server that starts or stops refuses before it asks.
    """
    text = str(cause)
    connection = getattr(cause, "pgconn", None)
    password_refused = connection is not None and (
        connection.needs_password or (connection.used_password and "FATAL" in text)
    )
    refused = password_refused or any(words in text for words in _FOR_A_PERSON)
    return refused and not any(words in text for words in _BUSY)
