"""Looks at a database without changing anything: no table, no file, no journal."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from urllib.parse import quote

import sqlalchemy as sa
from alembic.script import ScriptDirectory

from acqd.errors import UserError
from acqd.extras import install_command
from acqd.storage.database import MIGRATIONS
from acqd.storage.remedies import remedy
from acqd.storage.url import parse_url, shown

_VERSION = "SELECT version_num FROM alembic_version"
_TIMEOUT_S = 5


def inspect_database(url: str) -> str:
    """The state of a database in words: up to date, empty, or older. Raises UserError for one that cannot be used."""
    parsed = parse_url(url)
    try:
        if parsed.get_backend_name() == "sqlite":
            tables, version = _look_sqlite(Path(parsed.database or ":memory:"))
        else:
            tables, version = _look_server(parsed)
    except (sqlite3.Error, sa.exc.DBAPIError) as error:
        reason = (str(getattr(error, "orig", error)).strip() or type(error).__name__).splitlines()[0]
        advice = remedy(reason)
        raise UserError(f"database {shown(parsed)}: {reason}{'; ' if advice else ''}{advice or ''}") from None
    except ModuleNotFoundError as error:
        raise UserError(
            f"database {shown(parsed)} needs the {error.name} package: {install_command('postgres')}"
        ) from None
    return _state(shown(parsed), tables, version)


def _state(name: str, tables: set[str], version: str | None) -> str:
    script = ScriptDirectory(str(MIGRATIONS))
    known = [revision.revision for revision in script.walk_revisions()]
    if version is None and tables:
        raise UserError(f"database {name}: holds tables of another program ({len(tables)}); choose another one")
    if version is None:
        return f"{name} is empty; the sink sets it up"
    if version not in known:
        raise UserError(f"database {name}: was written by a newer acqd")
    return f"{name} is up to date" if version == known[0] else f"{name} is of an older acqd; the sink updates it"


def _look_sqlite(path: Path) -> tuple[set[str], str | None]:
    """Tables and schema version. Without a journal, `immutable` keeps SQLite from making one."""
    if path.is_dir():
        raise UserError(f"database {path}: is a folder; expected a file, such as {path / 'acqd.sqlite'}")
    if not path.stat().st_size:
        return set(), None
    journal = path.with_name(path.name + "-wal")
    mode = "mode=ro" if journal.exists() and journal.stat().st_size else "mode=ro&immutable=1"
    connection = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{mode}", uri=True, timeout=_TIMEOUT_S)
    try:
        tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        version = connection.execute(_VERSION).fetchone() if "alembic_version" in tables else None
    finally:
        connection.close()
    return tables, None if version is None else str(version[0])


def _look_server(url: sa.URL) -> tuple[set[str], str | None]:
    engine = sa.create_engine(url, connect_args={"connect_timeout": _TIMEOUT_S})
    try:
        with engine.connect() as connection:
            connection.exec_driver_sql("SET TRANSACTION READ ONLY")
            tables = set(sa.inspect(connection).get_table_names())
            version = connection.execute(sa.text(_VERSION)).scalar() if "alembic_version" in tables else None
    finally:
        engine.dispose()
    return tables, None if version is None else str(version)
