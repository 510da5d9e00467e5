"""A look at a database changes nothing."""

from __future__ import annotations

import os
import sqlite3

import pytest

from acqd.errors import UserError
from acqd.storage.database import open_database
from acqd.storage.inspect import inspect_database


def contents(folder):
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.iterdir()}


def test_another_programs_file_is_left_as_it_is(tmp_path):
    path = tmp_path / "theirs.sqlite"
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE songs (name)")
    connection.close()
    before = contents(tmp_path)
    with pytest.raises(UserError, match="tables of another program"):
        inspect_database(str(path))
    assert contents(tmp_path) == before


@pytest.mark.parametrize("wal", [False, True])
def test_a_database_of_acqd_is_known_and_left_as_it_is(tmp_path, wal):
    path = tmp_path / "a.sqlite"
    open_database(str(path)).dispose()
    keeper = sqlite3.connect(path) if wal else None
    if keeper:  # a journal, as while a sink writes
        keeper.execute("CREATE TABLE x (y)")
    before = contents(tmp_path)
    assert "up to date" in inspect_database(str(path))
    after = contents(tmp_path)
    assert {k: v for k, v in after.items() if not k.endswith("-shm")} == {
        k: v for k, v in before.items() if not k.endswith("-shm")
    }
    if keeper:
        keeper.close()


@pytest.mark.parametrize(("content", "complaint"), [(b"", "is empty"), (b"no database" * 100, "not a database")])
def test_other_files_are_named(tmp_path, content, complaint):
    path = tmp_path / "b.sqlite"
    path.write_bytes(content)
    if content:
        with pytest.raises(UserError, match=complaint):
            inspect_database(str(path))
    else:
        assert complaint in inspect_database(str(path))
    assert contents(tmp_path) == {"b.sqlite": (content, path.stat().st_mtime_ns)}


def test_an_older_and_a_newer_schema_are_told_apart(tmp_path):
    path = tmp_path / "a.sqlite"
    open_database(str(path)).dispose()
    for version, said in (("0001", "older acqd"), ("9999", "newer acqd")):
        with sqlite3.connect(path) as connection:
            connection.execute("UPDATE alembic_version SET version_num = ?", (version,))
        connection.close()
        try:
            text = inspect_database(str(path))
        except UserError as error:
            text = str(error)
        assert said in text


def test_a_server_is_only_asked(postgres):
    assert "is empty" in inspect_database(postgres)
    assert "is empty" in inspect_database(postgres)
    open_database(postgres).dispose()
    assert "up to date" in inspect_database(postgres)


def test_a_new_database_is_not_for_everybody(tmp_path):
    path = tmp_path / "n.sqlite"
    old = os.umask(0o022)
    try:
        with open_database(str(path)).begin() as connection:
            connection.exec_driver_sql("DELETE FROM power")
            modes = {file.name: oct(file.stat().st_mode & 0o777) for file in tmp_path.iterdir()}
    finally:
        os.umask(old)
    assert set(modes.values()) == {"0o640"}, modes
