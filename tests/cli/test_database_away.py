"""A database without tables, that is away or locked: one line and exit 2 for everybody who only looks."""

from __future__ import annotations

import sqlite3

import pytest
import sqlalchemy as sa

from acqd.storage.database import open_database, read_database, unanswered
from acqd.storage.row_series import row_series
from acqd.storage.writer import Writer
from acqd.telemetry.broker import free_port
from tests.commands import acqd_here, refused
from tests.storage.rows import message, row

COMMANDS = (
    ("plant", "page", "--no-broker"), ("plant", "month"), ("energy", "--last", "day", "--device", "cell1"),
    ("en50160", "--declared-voltage", "230"), ("alarms", "budgets"),
)  # fmt: skip


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_a_database_without_an_answer_is_one_line(tmp_path, words):
    sqlite3.connect(tmp_path / "empty.sqlite").close()
    away = f"postgresql://acqd:secret@127.0.0.1:{free_port()}/acqd"
    for url, why in ((str(tmp_path / "empty.sqlite"), "no such table"), (away, "onnection")):
        if words[0] == "alarms":
            (tmp_path / "acqd.toml").write_text(
                f"[sink]\ndatabase = '{url}'\n[[alarms.budgets]]\nper = 'day'\nkWh = 5.0\n"
            )
            done = acqd_here(*words, "--config", tmp_path / "acqd.toml", cwd=tmp_path)
        else:
            done = acqd_here(*words, "--database", url, cwd=tmp_path)
        line = refused(done)
        assert why in line and "database " in line and "secret" not in line


def test_a_bug_in_a_query_keeps_its_traceback(tmp_path):
    engine = open_database(str(tmp_path / "p.sqlite"))
    with engine.connect() as connection, pytest.raises(sa.exc.IntegrityError) as caught:
        connection.exec_driver_sql("INSERT INTO alembic_version VALUES (NULL)")
    assert unanswered(caught.value) is None and unanswered(ValueError()) is None


def test_rows_that_cannot_be_read_are_an_error_of_the_database(tmp_path, monkeypatch):
    """The rows are read by the driver itself, whose errors nobody else expects."""
    path = str(tmp_path / "p.sqlite")
    Writer(open_database(path)).write([message(row(k, "total", t=1000.0 + k, P=1.0, W=0.1)) for k in range(3)])
    monkeypatch.setattr("acqd.storage.row_series._piece", lambda *_: locked())

    def locked():
        raise sqlite3.OperationalError("database is locked")

    with read_database(path).connect() as connection, pytest.raises(sa.exc.OperationalError) as caught:
        list(row_series(connection, "cell1", "total", 900, 1100))
    assert "database is locked" in str(unanswered(caught.value))
