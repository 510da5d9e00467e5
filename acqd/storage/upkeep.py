"""Roll-ups and retention once a day by the sink itself, where no timer runs them; and how long the disk lasts."""

from __future__ import annotations

import logging
import re
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable

import sqlalchemy as sa

from acqd.errors import UserError
from acqd.storage.away import DatabaseAwayError
from acqd.storage.conversion import convert
from acqd.storage.database import file_of, first_line
from acqd.storage.maintain import Retention, maintain
from acqd.storage.quarantined import Restored, Which, restore
from acqd.storage.refusals import REFUSED, Refusals
from acqd.storage.retention_doubt import doubt, last_run, note_run, rows_past
from acqd.storage.room import fitted
from acqd.uptime import moment

_log = logging.getLogger(__name__)
_LOOK_S = 60.0
_AT_ONCE, _BETWEEN_S = 10_000, 0.1
"""Rows of an earlier acqd that are moved in one transaction, and a pause in which the sink commits."""
_DAY_S = 86_400.0
_OVERDUE_S = 26 * 3_600.0
"""A timer that runs daily has had its turn and two hours more."""
_FIRST_S = 600.0
"""A sink that has just started has a backlog to store first."""
_MOVING = "maintenance: rows of an earlier acqd"
"""A trouble of its own: it is over with the next look, and the rest of the maintenance has its turn much later."""
_REFUSED = "refused rows"
_NUMBER = re.compile(r"(?<![\w-])\d[\d.,:+TZ-]*(?!\w)")
"""That stands alone: an amount or a time, which changes while the trouble stays; not one within a name."""
_LOOKS = 61
"""The rate at which the disk fills is of the last hour."""


class Upkeep:
    """A thread; other threads read its attributes."""

    def __init__(
        self,
        engine: sa.Engine,
        retention: Retention,
        costs: Callable[[sa.Engine], int] = lambda _: 0,
        refusals: Refusals | None = None,
    ) -> None:
        """`costs` is called at every look, in the thread: it keeps a table of costs up to date."""
        self._refusals = refusals
        self._engine, self._retention, self._costs = engine, retention, costs
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="upkeep", daemon=True)
        self._free: deque[tuple[float, int]] = deque(maxlen=_LOOKS)
        self._moved = 0
        self._troubles = {_MOVING: "", _REFUSED: "", "maintenance": "", "costs": ""}
        self.disk_days: float | None = None
        """Until the disk of an SQLite database is full, at the rate of the last hour; None: unknown, or not filling."""

    @property
    def trouble(self) -> str:
        """Why rows are not moved, or roll-ups, retention or costs of quarter hours not kept, else empty."""
        return "; ".join(f"{part}: {why}" for part, why in self._troubles.items() if why)

    def start(self) -> None:
        """Look once a minute."""
        self._thread.start()

    def stop(self) -> None:
        """End after the transaction in progress at the latest a second from now; the rest is done another time."""
        self._stopping.set()
        self._thread.join(1.0)

    def _run(self) -> None:
        begun, pause_s = time.monotonic(), 0.0
        while not self._stopping.wait(pause_s):
            pause_s = _LOOK_S
            self._look_at_disk()
            moved = self._try(_MOVING, self._convert)
            if moved is not None:
                self._say(_MOVING, "")
            if moved:
                pause_s = _BETWEEN_S
            self._try(_REFUSED, self._restore_refused)
            if not moved and time.monotonic() - begun >= _FIRST_S:
                self._try("maintenance", self.run_if_due)
                if self._try("costs", lambda: self._costs(self._engine)) is not None:
                    self._say("costs", "")

    def _try(self, part: str, work: Callable[[], object]) -> object:
        """What `work` returns; None where it fails, which is said: the thread goes on whatever the rows hold."""
        try:
            return work()
        except sa.exc.DBAPIError as error:
            self._say(part, f"{first_line(error)}; trying again")
        except OSError as error:
            self._say(part, f"{error.strerror or error}; trying again")
        except UserError as error:
            self._say(part, str(error))
        except Exception as error:
            if self._say(part, f"{type(error).__name__}: {error}; trying again"):
                _log.exception("this is an error of acqd")
        return None

    def _convert(self) -> bool:
        """Move some rows of an earlier acqd; whether there may be more. Raises sqlalchemy.exc.DBAPIError."""
        path = file_of(self._engine)
        if path is None or not path.exists():  # SQLite would make it
            return False
        moved = convert(self._engine, _AT_ONCE)
        if moved and not self._moved:
            _log.info("rows of an earlier acqd are being moved into the layout of this one; the sink works meanwhile")
        self._moved += moved
        if self._moved and not moved:
            _log.info("%d rows of an earlier acqd have been moved", self._moved)
            self._moved = 0
        return moved > 0

    def _restore_refused(self) -> None:
        """Copies of rows that a changed table refused leave the quarantine when it takes them again."""
        refusals, path = self._refusals, file_of(self._engine)
        if refusals is None or not refusals.copies or refusals.trouble or (path is not None and not path.exists()):
            return
        done: Restored | None = None
        refusals.copies = False  # first, for the sink may keep one meanwhile
        try:
            done = restore(self._engine, Which(begins=REFUSED), until_refused=True)
        except (sa.exc.DBAPIError, DatabaseAwayError):
            return  # away, which the sink says
        finally:
            if done is None or done.refused:
                refusals.copies = True
        if done.restored:
            _log.info("%d rows that the database had refused left the quarantine: they are stored", done.restored)
        why = f"{done.why_refused}; copies wait in quarantine: mend the table, or `acqd sink quarantine drop` them"
        self._say(_REFUSED, why if done.refused else "")

    def run_if_due(self, now: Callable[[], float] = time.time) -> bool:
        """Make roll-ups and delete what is old, if the last run is more than a day ago; whether that was done.

        Raises sqlalchemy.exc.DBAPIError.
        """
        wall, last = now(), last_run(self._engine)
        if last is not None and min(last.moment.age_s(moment()), abs(wall - last.wall_ns / 1e9)) < _OVERDUE_S:
            self._say("maintenance", "")
            return False
        retention = fitted(self._engine, self._retention, wall)
        why = doubt(self._engine, retention, wall)
        if not why and last is None and (old := rows_past(self._engine, retention, wall)):
            why = f"no maintenance has run yet, and {old} rows are older than {retention.power_days:g} days"
        if why:
            maintain(self._engine, Retention(0, 0, 0), wall)
            self._say("maintenance", f"{why}; nothing was deleted: `acqd sink maintain --yes` if the clock is right")
            return False
        done = maintain(self._engine, retention, wall)
        note_run(self._engine, wall)
        _log.info(
            "maintenance: %d roll-ups made, %d rows deleted as older than %g days",
            done.rollup_1min + done.rollup_15min, done.power_deleted, retention.power_days,
        )  # fmt: skip
        self._say("maintenance", "")
        return True

    def _say(self, part: str, why: str) -> bool:
        """Whether it is a new trouble, and has been written to the log; empty: the trouble is over."""
        new = bool(why) and _NUMBER.sub("", why) != _NUMBER.sub("", self._troubles[part])
        self._troubles[part] = why
        if new:
            _log.error("%s: %s", part, why)
        return new

    def _look_at_disk(self) -> None:
        path = file_of(self._engine)
        try:
            free = shutil.disk_usage(path.absolute().parent).free if path is not None else None
        except OSError:
            free = None
        if free is None:
            return
        self._free.append((time.monotonic(), free))
        (begun, most), (now, least) = self._free[0], self._free[-1]
        used = most - least
        self.disk_days = free / (used / (now - begun)) / _DAY_S if used > 0 and len(self._free) > 10 else None
