"""The database when the sidecar starts: one that is away is waited for, as the sink does."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable

import sqlalchemy as sa

from acqd.retry import Backoff
from acqd.storage.away import DatabaseAwayError
from acqd.storage.database import open_database

_log = logging.getLogger(__name__)


async def opened(url: str, stop: asyncio.Event, alive: Callable[[], None]) -> sa.Engine | None:
    """Engine of the database at `url` once the database answers; None when `stop` was set before.

    Raises UserError when the database cannot be used, and for a SQLite file that is not there.
    """
    backoff, said = Backoff(), False
    while not stop.is_set():
        alive()
        try:
            engine = await asyncio.to_thread(open_database, url, create=False, hold=False)
        except DatabaseAwayError as error:
            if not said:
                _log.error("database: %s; logs wait, trying again", error.reason)
            said = True
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), backoff.pause_s())
            continue
        if said:
            _log.warning("the database answers")
        return engine
    return None
