"""Opening a database: engine, SQLite settings, migrations to the newest schema."""

from __future__ import annotations

import contextlib
import math
import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa

from acqd.atomic import private
from acqd.errors import UserError, without_number
from acqd.extras import install_command
from acqd.storage.away import DatabaseAwayError
from acqd.storage.conversion import convert
from acqd.storage.outage import is_outage
from acqd.storage.remedies import remedy
from acqd.storage.url import parse_url, shown

_PATIENCE_S = 30.0
_LOCK_S, _STATEMENT_S = 5.0, 30.0
_IMPATIENT = {
    # A server that has vanished without a word: detected within half a minute.
    **{"keepalives": 1, "keepalives_idle": 10, "keepalives_interval": 5, "keepalives_count": 3},
    "tcp_user_timeout": 30_000,
}
_FORMS = "SET LOCAL DateStyle = 'ISO, MDY'; SET LOCAL extra_float_digits = 1"
"""The driver reads no other times, and numbers keep their digits, whatever role and database are set to."""
_LIMITS = "; ".join(
    f"SET LOCAL {name} = '{seconds:.0f}s'"
    for name, seconds in (
        ("lock_timeout", _LOCK_S),
        ("statement_timeout", _STATEMENT_S),
        ("idle_in_transaction_session_timeout", _STATEMENT_S),
    )
)
"""As `_FORMS`, said in each transaction: a pooler takes no options, and lends a connection for a transaction only."""
_ON_DISK = "SELECT set_config('synchronous_commit', 'on', true) WHERE current_setting('synchronous_commit') = 'off'"
"""A receipt follows a commit, whatever role and database are set to; the other values are as strict or stricter."""
_OTHER_TABLES = ("no such table", "no such column")
_OTHER_TABLES_STATES = ("42P01", "42703")
"""Undefined table and column: SQLite says it in words, PostgreSQL by SQLSTATE."""
_RIGHTS = "give its role the right, or name another role in the URL (the sink's owns schema and tables)"
_CONVERTED_AT_ONCE = 50_000
"""Rows of an earlier acqd that are moved into the layout of this one while somebody waits; the sink moves the rest."""
MIGRATIONS = Path(__file__).parent / "migrations"


def open_database(url: str, *, create: bool = True, hold: bool = True) -> sa.Engine:
    """Engine for `url` (or a plain path: SQLite), with the schema brought up to date; `hold` as in `engine_for`.

    Raises UserError for a URL, path or server that cannot be used; without `create`, for a SQLite file that is not
    there or another program's, and for a server's database without tables, as an empty replica is: only the sink makes
    them.
    """
    engine = engine_for(url, hold=hold)
    sa.event.listen(engine, "handle_error", _named)
    if not create:
        _require_file(engine)
        _check_tables(engine)
    prepare(engine, create=create)
    return engine


def _check_tables(engine: sa.Engine) -> None:
    file = file_of(engine)
    try:
        there = _holds_tables(engine) if file is None else _may_be_ours(file)
    except (sa.exc.DBAPIError, sqlite3.Error):
        return  # `prepare` says why
    if there:
        return
    why = "empty, or another one; a sink makes them at its start" if file is None else "another program's; name another"
    raise UserError(f"database {shown(engine.url)} has no tables of acqd: {why}")


def _holds_tables(engine: sa.Engine) -> bool:
    with engine.connect() as connection:
        return sa.inspect(connection).has_table("power")


def _may_be_ours(file: Path) -> bool:
    """Whether an SQLite file has tables of acqd, or none yet. It is not touched: another program's stays as it is."""
    with contextlib.closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=rw", uri=True)) as connection:
        there = connection.execute("SELECT name FROM sqlite_master WHERE type IN ('table', 'view')")
        names = {name for (name,) in there}
    return not names or {"power", "alembic_version"} <= names


def prepare(engine: sa.Engine, *, create: bool = True) -> None:
    """Reach the database and bring its schema up to date; with `create`, make the file of SQLite where none is.

    Raises DatabaseAwayError while it is away, else UserError when it cannot be used.
    """
    try:
        if create:
            _make_file(engine)
        with engine.connect():
            pass
        migrate(engine)
        convert(engine, _CONVERTED_AT_ONCE)
    except sa.exc.DBAPIError as error:
        reason, permanent = first_line(error), not is_outage(error)
        foreign = permanent and not isinstance(error, sa.exc.OperationalError)
        advice = remedy(reason) or ("is it another program's file?" if foreign else _advice(engine))
        if _lacks_rights(error):
            advice = _RIGHTS
        elif "already exists" in reason:
            advice = "is it another program's database? Name another one"
        message = f"database {shown(engine.url)}: {reason}; {advice}"
        raise (UserError(message) if permanent else DatabaseAwayError(message, reason)) from None


def read_database(url: str) -> sa.Engine:
    """Engine for a viewer, who changes nothing; for answers within seconds, or errors.

    Raises UserError for a URL that cannot be used, and for a SQLite file that is not there.
    """
    engine = engine_for(url, impatient=True, viewing=True, hold=False)
    _require_file(engine)
    sa.event.listen(engine, "handle_error", _named)
    return engine


def unanswered(error: BaseException) -> str | None:
    """Why a database has no answer for a viewer, in one line; None for another error, which is a bug."""
    if not isinstance(error, sa.exc.DBAPIError):
        return None
    reason, state = first_line(error), getattr(error.orig, "sqlstate", None)
    name = next(iter(getattr(error, "__notes__", ())), "database")
    if _lacks_rights(error):
        return f"{name}: {reason}; {_RIGHTS}"
    if reason.startswith(_OTHER_TABLES) or state in _OTHER_TABLES_STATES:
        return f"{name}: {reason}; it is no database of this version of acqd; a sink makes and upgrades the tables"
    if (advice := remedy(reason)) is not None:
        return f"{name}: {reason}; {advice}"
    if is_outage(error) or isinstance(error, sa.exc.OperationalError):
        return f"{name}: {reason}; check that it answers, and try again"
    return f"{name}: {reason}; is it another program's file?" if type(error) is sa.exc.DatabaseError else None


def _named(context: sa.engine.ExceptionContext) -> None:
    """Errors of a viewer's engine name its database."""
    if context.sqlalchemy_exception is not None and context.engine is not None:
        context.sqlalchemy_exception.add_note(f"database {shown(context.engine.url)}")


@contextmanager
def transaction(engine: sa.Engine) -> Iterator[sa.Connection]:
    """All statements or none; SQLite's connections begin nothing by themselves (see _sqlite_settings)."""
    with engine.begin() as connection:
        if engine.dialect.name == "sqlite":
            connection.exec_driver_sql("BEGIN IMMEDIATE")
        yield connection


def migrate(engine: sa.Engine) -> None:
    """Bring the schema to the newest version; safe while several sinks start at once."""
    if _up_to_date(engine):
        return
    # A third of the start of a sink would be the import of this, and mostly there is nothing to do.
    from alembic import command
    from alembic.config import Config
    from alembic.util import CommandError

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    with engine.begin() as connection:
        if engine.dialect.name == "postgresql":
            connection.execute(sa.text("SELECT pg_advisory_xact_lock(4607182418800017408)"))
        else:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
        config.attributes["connection"] = connection
        try:
            command.upgrade(config, "head")
        except CommandError as error:
            raise UserError(f"database {shown(engine.url)}: {error}; it was written by a newer acqd") from None


def newest_version() -> str:
    """Of the schema: the number of the last migration."""
    return max((path.name[1:5] for path in (MIGRATIONS / "versions").glob("m[0-9]*.py")), default="")


def _up_to_date(engine: sa.Engine) -> bool:
    try:
        with engine.connect() as connection:
            version = connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar()
    except sa.exc.DBAPIError:  # without that table; `migrate` meets what else is wrong
        return False
    return version == newest_version()


def engine_for(url: str, *, impatient: bool = False, viewing: bool = False, hold: bool = True) -> sa.Engine:
    """Engine for a URL or path; nothing is opened yet.

    `impatient`: statements and locks that take longer than seconds are errors, for a caller that tries again.
    `viewing`: nothing is written. Without `hold`, a file is opened for each use: an idle connection would go on with a
    file that was replaced, and with its index of a write-ahead log that is gone, by which the sink finds no page.
    Raises UserError for a URL or a folder that cannot be used.
    """
    parsed = parse_url(url)
    try:
        if parsed.get_backend_name() == "sqlite":
            _check_folder(parsed.database)
            options = {} if hold or parsed.database in (None, "", ":memory:") else {"poolclass": sa.NullPool}
            patience = {"timeout": _LOCK_S if impatient else _PATIENCE_S}
            engine = sa.create_engine(parsed, connect_args=patience, **options)
            sa.event.listen(engine, "do_connect", _existing_file)
            sa.event.listen(engine, "connect", _sqlite_viewing if viewing else _sqlite_settings)
            return engine
        # A statement that was prepared on one connection of a pooler is unknown on the next one.
        arguments = {"connect_timeout": 5, "prepare_threshold": None, **(_IMPATIENT if impatient else {})}
        engine = sa.create_engine(parsed, pool_pre_ping=True, connect_args=arguments)
        limits = f"; {_LIMITS}; {'SET TRANSACTION READ ONLY' if viewing else _ON_DISK}" if impatient else ""
        sa.event.listen(engine, "begin", lambda connection: connection.exec_driver_sql(f"{_FORMS}{limits}"))
        return engine
    except ModuleNotFoundError as error:
        raise UserError(
            f"database {shown(parsed)} needs the {error.name} package: {install_command('postgres')}"
        ) from None


def _require_file(engine: sa.Engine) -> None:
    """Raises UserError where SQLite's file is not there."""
    path = engine.url.database
    if engine.dialect.name == "sqlite" and path and not Path(path).exists():
        raise UserError(f"database {Path(path).absolute()}: no such file; check its path and the folder you are in")


def _check_folder(path: str | None) -> None:
    if path and path != ":memory:" and not Path(path).absolute().parent.is_dir():
        raise UserError(f"database {path}: folder {Path(path).absolute().parent} does not exist; create it")
    if path and Path(path).is_dir():
        raise UserError(f"database {path}: is a folder; expected a file, such as {Path(path) / 'acqd.sqlite'}")


def file_of(engine: sa.Engine) -> Path | None:
    """The file of an SQLite database; None for a server or memory."""
    path = engine.url.database
    return Path(path) if engine.dialect.name == "sqlite" and path and path != ":memory:" else None


def _existing_file(_dialect: Any, _record: Any, arguments: list[Any], options: dict[str, Any]) -> None:
    """Only `prepare` makes a file: SQLite would make an empty one in the place of a file that was moved away, and then
    delete the write-ahead log that is beside it, with the rows that it holds.
    """
    if arguments and arguments[0] not in ("", ":memory:"):
        arguments[0] = f"{Path(arguments[0]).absolute().as_uri()}?mode=rw"
        options["uri"] = True


def _sqlite_functions(connection: Any) -> None:
    connection.isolation_level = None  # transactions are begun by us, not guessed by sqlite3
    connection.create_function("sqrt", 1, lambda x: None if x is None else math.sqrt(x), deterministic=True)


def _sqlite_viewing(connection: Any, _record: Any) -> None:
    """Not `mode=ro`: such a connection leaves the -wal and -shm files that it has made when it was the only one."""
    _sqlite_functions(connection)
    connection.execute("PRAGMA query_only=ON").close()


def _sqlite_settings(connection: Any, record: Any) -> None:
    # WAL: readers never wait for the sink. FULL: a commit is on the disk before it returns, because a receipt follows
    # it, and then the daemon forgets the rows (ADR 31).
    _sqlite_functions(connection)
    cursor = connection.cursor()
    _to_wal(cursor)
    cursor.execute("PRAGMA synchronous=FULL")
    _, _, path = cursor.execute("PRAGMA database_list").fetchone()
    with contextlib.suppress(OSError):
        there = os.stat(path) if path else None
        record.info["file"] = (there.st_dev, there.st_ino) if there is not None else None
    cursor.close()


def _to_wal(cursor: sqlite3.Cursor) -> None:
    """Write-ahead log; SQLite does not wait by itself when others switch a new file at the same moment."""
    patience_ends = time.monotonic() + _PATIENCE_S
    while True:
        try:
            cursor.execute("PRAGMA journal_mode=WAL")
            return
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or time.monotonic() > patience_ends:
                raise
            time.sleep(0.02)


def _make_file(engine: sa.Engine) -> None:
    """A new SQLite file is not for everybody (0640); SQLite gives its journals the mode of the file.

    Raises DatabaseAwayError where only the write-ahead log is there: it holds rows, and SQLite deletes the log of a
    file that is empty.
    """
    path = file_of(engine)
    if path is None or path.exists():
        return
    log = Path(f"{os.path.realpath(path)}-wal")  # beside the file that a symbolic link leads to
    with contextlib.suppress(OSError):  # SQLite says why
        if log.exists() and log.stat().st_size:
            text = f"{shown(engine.url)}: no such file, but its write-ahead log {log.name} holds rows: moved away? "
            text += "Put it back; to begin with an empty database, delete the log, too"
            raise DatabaseAwayError(f"database {text}", text)
        os.close(private(str(path), os.O_CREAT | os.O_RDWR | os.O_CLOEXEC))


def _lacks_rights(error: sa.exc.DBAPIError) -> bool:
    """Whether PostgreSQL knows the role, and does not let it do this (SQLSTATE 42501)."""
    return getattr(error.orig, "sqlstate", None) == "42501"


def _advice(engine: sa.Engine) -> str:
    if engine.dialect.name == "sqlite":
        return "check that the file and its folder may be written by this user and that the disk is not full"
    return "check host, port, user, password and that the database exists"


def first_line(error: sa.exc.DBAPIError) -> str:
    """What the database or its driver says, in one line."""
    return without_number((str(error.orig).strip().splitlines() or [type(error.orig).__name__])[0])
