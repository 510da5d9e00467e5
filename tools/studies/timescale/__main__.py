"""Migrations, the sink's writer and the maintenance against a real TimescaleDB, which runs in WebAssembly.

    mkdir ts && cp tools/studies/timescale/server.mjs ts && cd ts && npm install ... (see server.mjs)
    python -m tools.studies.timescale ts

That build takes no COPY through its socket, so rows are inserted one by one here. Simulated rows. Exit 1 when a row is
missing, stored twice, or a statement of docs/scaling.md is refused. By hand only.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Annotated, Any
from unittest import mock

import sqlalchemy as sa
import typer
from msgspec.structs import replace

from acqd.cli.main import for_people
from acqd.errors import UserError
from acqd.storage import rows as stored_rows
from acqd.storage.database import engine_for, migrate
from acqd.storage.maintain import Retention, maintain
from acqd.storage.received import Received
from acqd.storage.writer import Writer
from acqd.telemetry.ports import free_port
from acqd.telemetry.row import CHANNELS, PowerRow
from acqd.timestamps import filetime, rfc3339

_WINDOWS = 300
_BEGIN_NS = 1_700_000_000_000_000_000
_LATER_S = 1.7e9 + 40 * 86_400
_VERSION = "SELECT extversion FROM pg_extension WHERE extname = 'timescaledb'"
_PAGE = Path(__file__).parents[3] / "docs" / "scaling.md"


def timescale(folder: Annotated[Path, typer.Argument(help="With server.mjs and its packages.")]) -> None:
    """Write rows, write them again into compressed chunks, roll up and delete.

    Example: python -m tools.studies.timescale ts
    """
    port = free_port()
    with subprocess.Popen(["node", "server.mjs", str(port)], cwd=folder, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        if server.stdout.readline().strip() != "ready":
            raise UserError(f"{folder}: server.mjs does not start; install its packages (see its first lines)")
        try:
            with mock.patch.object(stored_rows, "_copy", _one_by_one):
                good = _study(f"postgresql://postgres:postgres@127.0.0.1:{port}/postgres?sslmode=disable")
        finally:
            server.kill()
    raise SystemExit(0 if good else 1)


def _study(url: str) -> bool:
    """Whether all was as it has to be."""
    one = {"poolclass": sa.pool.StaticPool, "connect_args": {"prepare_threshold": None}}
    engine = sa.create_engine(engine_for(url).url, **one)  # the server has one connection
    migrate(engine)
    rows = [_row(k, channel) for k in range(_WINDOWS) for channel in CHANNELS]
    writer = Writer(engine)
    found = {"rows": _written(writer, rows), "again": _written(writer, rows[200:600])}
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        version = connection.exec_driver_sql(_VERSION).scalar()
        for statement in [*_statements(), "SELECT compress_chunk(chunk) FROM show_chunks('power') chunk"]:
            connection.exec_driver_sql(statement)
    found["again, compressed"] = _written(writer, rows[100:500])
    found["other values, compressed"] = _written(writer, [replace(rows[0], P=9.0)])
    with engine.connect() as connection:
        stored = connection.exec_driver_sql("SELECT count(*) FROM power").scalar()
    done = maintain(engine, Retention(30, 60, 60), _LATER_S)
    print(f"TimescaleDB {version}: stored {stored} of {len(rows)}; (rows, in quarantine): {found}; {done}")
    expected = {"rows": (1200, 0), "again": (400, 0), "again, compressed": (400, 0), "other values, compressed": (0, 1)}
    return stored == len(rows) and found == expected and done.power_deleted == len(rows)


def _statements() -> list[str]:
    """SQL of the page on scaling that needs the extension."""
    blocks = re.findall(r"```sql\n(.*?)```", _PAGE.read_text(encoding="utf-8"), re.DOTALL)
    every = [statement.strip() for block in blocks for statement in block.split(";")]
    return [statement for statement in every if re.search("timescaledb|_policy", statement)]


def _written(writer: Writer, rows: list[PowerRow]) -> tuple[int, int]:
    written = writer.write([Received(f"acqd/{row.device}/{row.channel}/power", row.to_json()) for row in rows])
    return written.rows, written.quarantined


def _row(k: int, channel: Any) -> PowerRow:
    ns = _BEGIN_NS + k * 40_000_000
    values = 230.1, 1.2, 270.3, 276.1, 0.98, 50.0, k * 1e-6
    return PowerRow("cell1", channel, "b", k, rfc3339(ns), filetime(ns), *values, [])


def _one_by_one(connection: sa.Connection, table: str, columns: str, values: list[tuple[Any, ...]]) -> int:
    """As COPY: how many rows were taken, and its errors."""
    cursor: Any = connection.connection.cursor()
    try:
        for row in values:
            cursor.execute(f"INSERT INTO {table} ({columns}) VALUES ({', '.join(['%s'] * len(row))})", row)
    except connection.dialect.loaded_dbapi.Error as error:
        raise sa.exc.DBAPIError("INSERT", None, error) from error
    return len(values)


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(timescale)
    for_people(app)
