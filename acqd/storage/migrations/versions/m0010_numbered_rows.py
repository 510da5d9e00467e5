"""SQLite: rows by number, in a third of the bytes (ADR 42); `power` becomes a view with the columns that it had.

PostgreSQL keeps its table. Rows of a database of an earlier acqd stay in `power_before`, which the view includes, until
`storage.conversion` has moved them: this migration is short, however large the file is.
"""

import sqlalchemy as sa

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

COLUMNS = (
    "device", "channel", "boot", "seq", "time", "filetime", "Vrms", "Irms", "P", "S", "PF", "f", "W", "flags", "schema",
)  # fmt: skip
_TABLES = (
    "CREATE TABLE power_run (id INTEGER PRIMARY KEY, device TEXT NOT NULL, boot TEXT NOT NULL, channel TEXT NOT NULL,"
    " base INTEGER NOT NULL, UNIQUE (device, boot, channel, base))",
    'CREATE TABLE power_mark (id INTEGER PRIMARY KEY, flags TEXT NOT NULL, "S" INTEGER NOT NULL, "PF" INTEGER NOT NULL,'
    ' "schema" INTEGER NOT NULL, UNIQUE (flags, "S", "PF", "schema"))',
    'CREATE TABLE power_row (id INTEGER PRIMARY KEY, mark INTEGER NOT NULL, filetime INTEGER NOT NULL, "Vrms" REAL,'
    ' "Irms" REAL, "P" REAL, "S" REAL, "PF" REAL, f REAL, "W" REAL)',
    "CREATE INDEX power_row_filetime ON power_row (filetime)",
    'CREATE TABLE power_stamp (id INTEGER PRIMARY KEY, "time" TEXT NOT NULL)',
)
_S = 'CASE WHEN m."S" THEN v."Vrms" * v."Irms" ELSE v."S" END'


def _time(row: str) -> str:
    us = f"({row}.filetime - 116444736000000000) / 10"
    return f"strftime('%Y-%m-%dT%H:%M:%S', {us} / 1000000, 'unixepoch') || printf('.%06dZ', {us} % 1000000)"


_TIME = f'coalesce(t."time", {_time("v")})'
_CHANNEL = (
    "CASE WHEN r.channel <> '' THEN r.channel ELSE"
    " CASE v.id & 3 WHEN 0 THEN 'L1' WHEN 1 THEN 'L2' WHEN 2 THEN 'L3' ELSE 'total' END END"
)
SELECT = (
    f"SELECT r.device AS device, {_CHANNEL} AS channel, r.boot AS boot, r.base + ((v.id >> 2) & 4294967295) AS seq,"
    f' {_TIME} AS "time", v.filetime AS filetime, v."Vrms" AS "Vrms", v."Irms" AS "Irms", v."P" AS "P", {_S} AS "S",'
    f' CASE WHEN m."PF" THEN v."P" / ({_S}) ELSE v."PF" END AS "PF", v.f AS f, v."W" AS "W", m.flags AS flags,'
    ' m."schema" AS "schema" FROM power_row v'
    " JOIN power_run r ON r.id = v.id >> 34 AND v.id >= r.id << 34 AND v.id < (r.id + 1) << 34"
    " JOIN power_mark m ON m.id = v.mark LEFT JOIN power_stamp t ON t.id = v.id"
)
"""Rows as the view has them; `v.id` is run << 34 | (seq - base) << 2 | channel."""
_QUOTED = ", ".join(f'"{name}"' for name in COLUMNS)


def _number(row: str) -> str:
    """SQL for the id of the row `NEW` or `OLD` of a trigger."""
    code = f"CASE {row}.channel WHEN 'L2' THEN 1 WHEN 'L3' THEN 2 WHEN 'total' THEN 3 ELSE 0 END"
    return (
        f"(SELECT (id << 34) | (({row}.seq & 4294967295) << 2) | {code} FROM power_run WHERE device = {row}.device"
        f" AND boot = {row}.boot AND channel = {_other(row)} AND base = ({row}.seq >> 32) << 32)"
    )


def _other(row: str) -> str:
    return f"CASE WHEN {row}.channel IN ('L1', 'L2', 'L3', 'total') THEN '' ELSE {row}.channel END"


def _insert() -> str:
    S = 'NEW."S" IS NOT NULL AND NEW."S" IS NEW."Vrms" * NEW."Irms"'
    PF = 'NEW."PF" IS NOT NULL AND NEW."PF" IS NEW."P" / NEW."S"'
    number = _number("NEW")
    return (
        f"INSERT OR IGNORE INTO power_run (device, boot, channel, base) VALUES (NEW.device, NEW.boot, {_other('NEW')},"
        ' (NEW.seq >> 32) << 32); INSERT OR IGNORE INTO power_mark (flags, "S", "PF", "schema")'
        f' VALUES (NEW.flags, {S}, {PF}, NEW."schema"); INSERT INTO power_stamp SELECT {number}, NEW."time"'
        f' WHERE NEW."time" IS NOT {_time("NEW")};'
        f' INSERT INTO power_row SELECT {number}, id, NEW.filetime, NEW."Vrms", NEW."Irms", NEW."P",'
        f' CASE WHEN "S" THEN NULL ELSE NEW."S" END, CASE WHEN "PF" THEN NULL ELSE NEW."PF" END, NEW.f, NEW."W"'
        f' FROM power_mark WHERE flags = NEW.flags AND "S" = ({S}) AND "PF" = ({PF}) AND "schema" = NEW."schema";'
    )


def _delete(*, before: bool) -> str:
    number = _number("OLD")
    key = " AND ".join(f"{name} = OLD.{name}" for name in ("device", "channel", "boot", "seq"))
    also = f" DELETE FROM power_before WHERE {key};" if before else ""
    return f"DELETE FROM power_row WHERE id = {number}; DELETE FROM power_stamp WHERE id = {number};{also}"


def views(*, before: bool) -> list[str]:
    """Statements that make the view, and let SQL insert, change and delete rows as in the table that it was."""
    union = f" UNION ALL SELECT {_QUOTED} FROM power_before" if before else ""
    delete = _delete(before=before)
    return [
        "DROP VIEW IF EXISTS power",
        f"CREATE VIEW power AS {SELECT}{union}",
        f"CREATE TRIGGER power_insert INSTEAD OF INSERT ON power BEGIN {_insert()} END",
        f"CREATE TRIGGER power_delete INSTEAD OF DELETE ON power BEGIN {delete} END",
        f"CREATE TRIGGER power_update INSTEAD OF UPDATE ON power BEGIN {delete} {_insert()} END",
    ]


def upgrade() -> None:
    """Set rows of an earlier acqd aside, where there are any."""
    from alembic import op  # what reads rows imports this module, and Alembic is slow to import

    bind = op.get_bind()
    if bind.dialect.name != "sqlite":
        return
    before = bind.execute(sa.text("SELECT 1 FROM power LIMIT 1")).scalar() is not None
    bind.execute(sa.text("ALTER TABLE power RENAME TO power_before" if before else "DROP TABLE power"))
    for statement in (*_TABLES, *views(before=before)):
        bind.exec_driver_sql(statement)


def downgrade() -> None:
    """Back to a table."""
    from alembic import op  # what reads rows imports this module, and Alembic is slow to import

    bind = op.get_bind()
    if bind.dialect.name != "sqlite":
        return
    numbers = ", ".join(f'"{name}" REAL' for name in ("Vrms", "Irms", "P", "S", "PF", "f", "W"))
    bind.exec_driver_sql(
        "CREATE TABLE power_table (device TEXT NOT NULL, channel TEXT NOT NULL, boot TEXT NOT NULL,"
        f' seq INTEGER NOT NULL, "time" TEXT NOT NULL, filetime INTEGER NOT NULL, {numbers}, flags JSON NOT NULL,'
        ' "schema" SMALLINT NOT NULL, PRIMARY KEY (device, channel, boot, seq))'
    )
    bind.exec_driver_sql(f"INSERT INTO power_table SELECT {_QUOTED} FROM power")
    bind.exec_driver_sql("DROP VIEW power")
    for name in ("power_row", "power_run", "power_mark", "power_stamp"):
        bind.exec_driver_sql(f"DROP TABLE {name}")
    bind.exec_driver_sql("DROP TABLE IF EXISTS power_before")
    bind.exec_driver_sql("ALTER TABLE power_table RENAME TO power")
    bind.exec_driver_sql("CREATE INDEX power_filetime ON power (filetime)")
