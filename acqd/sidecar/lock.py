"""A lock that lets only one sidecar work on a database: there is only one memory of clock and drift."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator

import sqlalchemy as sa

from acqd.atomic import private
from acqd.errors import UserError

_ADVISORY_LOCK = 4607182418800017409


@contextlib.contextmanager
def exclusive(engine: sa.Engine) -> Iterator[None]:
    """Keeps other sidecars off this database. Raises UserError if another one works on it."""
    with contextlib.ExitStack() as stack:
        if not _locked(engine, stack):
            raise UserError("another sidecar works on this database; stop it, or give this one its own --database")
        yield


def _locked(engine: sa.Engine, stack: contextlib.ExitStack) -> bool:
    """Whether the lock was free; it is held until the stack is closed or the process dies."""
    if engine.dialect.name == "postgresql":
        connection = stack.enter_context(engine.execution_options(isolation_level="AUTOCOMMIT").connect())
        connection.detach()  # the lock ends with the connection, which must not go back to the pool
        return bool(connection.execute(sa.select(sa.func.pg_try_advisory_lock(_ADVISORY_LOCK))).scalar())
    path = engine.url.database
    if not path or path == ":memory:":
        return True
    file = private(f"{path}.sidecar-lock", os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
    stack.callback(os.close, file)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
