"""Faults of a PostgreSQL server that somebody else administers: rights, settings, a pooler, the disk of its log."""

from __future__ import annotations

import os
import random
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

import sqlalchemy as sa

from acqd.telemetry.ports import free_port
from tools.studies.faults.bed import Bed
from tools.studies.faults.fault import RESTART_S, Fault, pause
from tools.studies.faults.process import Process
from tools.studies.faults.servers import ROLE, listens

_TABLES, _OWNERS = "ALL TABLES IN SCHEMA public", "PUBLIC, pg_database_owner"
_TAKEN = (
    (f"REVOKE INSERT ON {_TABLES} FROM {ROLE}", f"GRANT INSERT ON {_TABLES} TO {ROLE}"),
    (f"REVOKE ALL ON power FROM {ROLE}", f"GRANT ALL ON power TO {ROLE}"),
    (f"REVOKE ALL ON database_state FROM {ROLE}", f"GRANT ALL ON database_state TO {ROLE}"),
    (f"REVOKE USAGE ON SCHEMA public FROM {_OWNERS}", f"GRANT USAGE ON SCHEMA public TO {_OWNERS}"),
    (f"ALTER ROLE {ROLE} NOLOGIN", f"ALTER ROLE {ROLE} LOGIN"),
    (f"ALTER ROLE {ROLE} CONNECTION LIMIT 0", f"ALTER ROLE {ROLE} CONNECTION LIMIT -1"),
    ("ALTER DATABASE postgres SET default_transaction_read_only = on", "ALTER DATABASE postgres RESET ALL"),
)
"""What an administrator takes, and gives back."""
_SETTINGS = {
    "timezone": ("Europe/Berlin", "America/St_Johns", "Pacific/Kiritimati", "Asia/Kathmandu"),
    "datestyle": ("SQL, DMY", "German", "Postgres, MDY"),
    "client_encoding": ("LATIN1", "UTF8"),
    "standard_conforming_strings": ("off", "on"),
    "extra_float_digits": ("0", "-15"),
    "bytea_output": ("escape", "hex"),
    "intervalstyle": ("iso_8601",),
    "default_transaction_isolation": ("serializable", "'repeatable read'"),
    "synchronous_commit": ("on", "local"),
    "search_path": ("public, pg_catalog", "'$user', public"),
}
_WAL_SWITCHES = 12


def rights_taken(bed: Bed, chance: random.Random) -> None:
    """The role of the sink loses a right for some seconds."""
    taken, given = chance.choice(_TAKEN)
    as_administrator(bed, taken, DISCONNECT)
    try:
        pause(chance, 1.0, 5.0)
    finally:
        as_administrator(bed, given, DISCONNECT)


def settings_changed(bed: Bed, chance: random.Random) -> None:
    """Role or database have another time zone, another style of dates and so on, and the sessions begin again."""
    of = chance.choice([f"ROLE {ROLE}", "DATABASE postgres"])
    some = chance.sample(sorted(_SETTINGS), 4)
    as_administrator(bed, *(f"ALTER {of} SET {name} = {_quoted(chance.choice(_SETTINGS[name]))}" for name in some))
    as_administrator(bed, DISCONNECT)
    pause(chance, 1.0, 4.0)
    as_administrator(bed, f"ALTER {of} RESET ALL", DISCONNECT)


def log_disk_full(bed: Bed, chance: random.Random) -> None:
    """Somebody else's file takes all room for the server's write-ahead log: the server panics at its next file."""
    assert bed.database is not None
    disk = bed.disks["log"]
    disk.fill()
    use_up_log(bed)
    pause(chance, 1.0, 4.0)
    disk.free()
    bed.database.revive()


def use_up_log(bed: Bed) -> None:
    """Begin one file of the write-ahead log after the other, until the server cannot."""
    with suppress(sa.exc.SQLAlchemyError):
        for _ in range(_WAL_SWITCHES):
            as_administrator(bed, "SELECT pg_switch_wal()", "CHECKPOINT", f"COMMENT ON ROLE {ROLE} IS 'x'")


def pooler(bed: Bed, chance: random.Random) -> None:
    """The sink reaches the server through PgBouncer, which lends a connection for a transaction, and is restarted."""
    port, folder = free_port(), bed.folder / "pooler"
    folder.mkdir(exist_ok=True)
    folder.chmod(0o777)
    server = sa.engine.make_url(bed.url)
    (folder / "users").write_text(f'"{ROLE}" ""\n')
    config = folder / "pgbouncer.ini"
    config.write_text(
        f"[databases]\npostgres = host=127.0.0.1 port={server.port} dbname=postgres\n"
        "[pgbouncer]\nlisten_addr = 127.0.0.1\n"
        f"listen_port = {port}\nunix_socket_dir =\nauth_type = trust\nauth_file = {folder / 'users'}\n"
        "pool_mode = transaction\ndefault_pool_size = 2\n"
    )
    user: dict[str, Any] = {"user": "postgres", "cwd": "/"} if os.geteuid() == 0 else {}
    process = Process([POOLER, str(config)], folder / "log", lambda: listens(port), user)
    process.start()
    direct = bed.folder / "sink.toml"
    text = direct.read_text()
    direct.write_text(text.replace(bed.url, str(server.set(port=port))))
    _restart(bed.sink)
    pause(chance, 2.0, 4.0)
    process.stop()
    pause(chance, *RESTART_S)
    process.start()
    pause(chance, 1.0, 3.0)
    direct.write_text(text)
    _restart(bed.sink)
    process.stop()


def _restart(process: Process) -> None:
    process.stop()
    process.start()


def _quoted(value: str) -> str:
    return value if value.startswith("'") or "," in value else f"'{value}'"


def as_administrator(bed: Bed, *statements: str) -> None:
    """Run statements, each in a transaction, as one who may everything."""
    with bed.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        for statement in statements:
            connection.exec_driver_sql(statement)


def missing_pooler() -> str:
    """Why this computer cannot have a pooler, else empty."""
    return "" if Path(POOLER).exists() else "PgBouncer is not installed: apt install pgbouncer"


DISCONNECT = f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE usename = '{ROLE}'"
POOLER = shutil.which("pgbouncer", path=f"{os.environ.get('PATH', '')}:/usr/sbin") or "/usr/sbin/pgbouncer"
FAULTS: dict[str, Fault] = {
    "PostgreSQL: rights taken": rights_taken,
    "PostgreSQL: settings changed": settings_changed,
    "PostgreSQL: disk of its log full": log_disk_full,
    "PostgreSQL: pooler": pooler,
}
