"""Whether this computer's clock may decide that rows are old: before rows are deleted for their age (ADR 30)."""

from __future__ import annotations

from operator import attrgetter

import sqlalchemy as sa

from acqd.storage import known_rows, state
from acqd.storage.database import transaction
from acqd.storage.maintain import Retention, power_cut
from acqd.storage.schema import database_state, power
from acqd.timestamps import filetime, rfc3339, unix_s
from acqd.uptime import Moment, moment

_DAY = 86_400
_SLACK_S = 3_600.0
_LONGEST_OFF_S = 7 * _DAY
"""A computer that was switched off for longer is a reason to ask a person; the clock may be what has gone."""


def note_run(engine: sa.Engine, now: float, elapsed: Moment | None = None) -> None:
    """Remember the clocks of a run, for the next one."""
    with transaction(engine) as connection:
        before = state.read_mark(connection, state.MAINTAINED)
        number = 1 if before is None else before.number + 1
        state.write_mark(connection, state.MAINTAINED, state.Mark(number, round(now * 1e9), elapsed or moment()))


def last_run(engine: sa.Engine) -> state.Mark | None:
    """The clocks of the last run; None before the first."""
    with engine.connect() as connection:
        return state.read_mark(connection, state.MAINTAINED)


def doubt(engine: sa.Engine, retention: Retention, now: float, elapsed: Moment | None = None) -> str:
    """Why rows are not to be deleted without a person, in one sentence; empty: go on. `now` is Unix seconds."""
    elapsed = elapsed or moment()
    with engine.connect() as connection:
        old = _rows_before(connection, power_cut(retention, now))
        if not old:
            return ""
        why = _newest_row(connection, now) or _progress(connection, now, elapsed)
    return f"{old} rows would be deleted as older than {retention.power_days:g} days, but {why}" if why else ""


def rows_past(engine: sa.Engine, retention: Retention, now: float) -> int:
    """How many rows are past their retention."""
    with engine.connect() as connection:
        return _rows_before(connection, power_cut(retention, now))


def _rows_before(connection: sa.Connection, cut: float) -> int:
    if not cut:
        return 0
    old = power.c.filetime < filetime(int(cut) * 10**9)
    return int(connection.execute(sa.select(sa.func.count()).select_from(power).where(old)).scalar_one())


def _newest_row(connection: sa.Connection, now: float) -> str:
    """The newest row is of about now, where anything meters."""
    newest = known_rows.newest(connection)
    distance = now - unix_s(int(newest)) if newest is not None else 0.0
    if abs(distance) <= _DAY:
        return ""
    where = "before" if distance > 0 else "after"
    return f"the newest row is {abs(distance) / _DAY:.1f} days {where} this computer's clock ({_text(now)})"


def _progress(connection: sa.Connection, now: float, elapsed: Moment) -> str:
    """The clock has gone as far as the computer has been running, since the last run and since the last commits.

    A commit of later than now proves nothing: the clock was wrong then, or is now. A run of the maintenance that agrees
    with the clock, of which a person may have said that it is right, decides then.
    """
    keys = database_state.c.key
    wanted = sa.or_(keys == state.MAINTAINED, keys.startswith(state.commits("")))
    names = connection.execute(sa.select(keys).where(wanted)).scalars().all()
    marks = {key: mark for key in names if (mark := state.read_mark(connection, key)) is not None}
    latest = max(marks.values(), key=attrgetter("wall_ns"), default=None)
    if latest is not None and latest.wall_ns / 1e9 - now > _SLACK_S and state.MAINTAINED not in marks:
        return (
            f"a sink has committed rows at {rfc3339(latest.wall_ns, 0)}, later than this computer's clock "
            f"({_text(now)}): it was wrong then, or is now"
        )
    for key, mark in marks.items():
        gone, same = now - mark.wall_ns / 1e9, mark.moment.start == elapsed.start
        ran = mark.moment.age_s(elapsed)
        if gone > ran + (_SLACK_S if same else _LONGEST_OFF_S):
            since = "maintenance" if key == state.MAINTAINED else "commit of a sink"
            return (
                f"this computer's clock ({_text(now)}) has gone {gone / _DAY:.1f} days since the last {since}, "
                f"and the computer has been running for {ran / _DAY:.1f} days"
            )
    return ""


def _text(now: float) -> str:
    return rfc3339(int(now) * 10**9, 0)
