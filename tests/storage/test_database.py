"""Opening a database and its schema."""

from __future__ import annotations

import shutil
import subprocess
import sys
import threading

import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory

from acqd.errors import UserError
from acqd.storage.database import MIGRATIONS, newest_version, open_database, read_database
from acqd.storage.schema import metadata
from tests.storage.rows import count


def test_migrations_give_exactly_the_declared_schema(database):
    engine = open_database(database)
    with engine.connect() as connection:
        options = {"compare_type": False}
        difference = compare_metadata(MigrationContext.configure(connection, opts=options), metadata)
        columns = [one["name"] for one in sa.inspect(connection).get_columns("power")]
    numbered = (
        "power",
        "power_run",
        "power_mark",
        "power_row",
        "power_stamp",
    )  # SQLite: `power` is a view of the others
    expected = [] if engine.dialect.name == "postgresql" else ["add_table", *["remove_table"] * 4]
    difference = [entry for entry in difference if entry[0] != "remove_index"]
    assert [entry[0] for entry in difference if entry[1].name in numbered] == expected == [one[0] for one in difference]
    assert columns == [column.name for column in metadata.tables["power"].columns]


def test_a_database_that_is_up_to_date_is_opened_without_what_brings_it_there(tmp_path):
    """A sink that is started again imports no Alembic, which takes longer than all else that it does."""
    assert newest_version() == ScriptDirectory(str(MIGRATIONS)).get_current_head()
    path = str(tmp_path / "a.sqlite")
    open_database(path)
    script = (
        "import sys, acqd.storage.sink; from acqd.storage.database import open_database; "
        f"open_database({path!r}); print([name for name in sys.modules if name.startswith('alembic')])"
    )
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True).stdout == "[]\n"


@pytest.mark.parametrize("folder", ["100 % acqd", "%(here)s", "%%", "Anlage ü ${x} %s"])
def test_the_installation_and_the_database_may_be_in_a_folder_of_any_name(tmp_path, monkeypatch, folder):
    """Alembic reads its settings through configparser, to which a percent sign is the begin of a reference."""
    installed = tmp_path / folder
    shutil.copytree(MIGRATIONS, installed, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr("acqd.storage.database.MIGRATIONS", installed)
    engine = open_database(str(installed / "a %.sqlite"))
    assert count(engine) == 0 and (installed / "a %.sqlite").exists()


def test_opening_again_and_from_several_sinks_at_once_is_harmless(database):
    errors = []

    def open_it():
        try:
            open_database(database).dispose()
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=open_it) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    assert count(open_database(database)) == 0


@pytest.mark.parametrize(
    ("url", "complaint"),
    [("sqlite:////nowhere/at/all/x.sqlite", "does not exist"), ("oracle://x/y", "expected sqlite"),
     ("://", "cannot be understood"),
     ("postgresql://u:x@h:abc/z", "cannot be understood"),
     ("postgresql://acqd@127.0.0.1:1/x", "check host")],
)  # fmt: skip
def test_unusable_databases_are_named(url, complaint):
    with pytest.raises(UserError, match=complaint):
        open_database(url)


def test_a_file_that_is_no_database_is_named_and_left_alone(tmp_path):
    path = tmp_path / "a.sqlite"
    path.write_bytes(b"not a database, but somebody's file" * 100)
    with pytest.raises(UserError, match=r"a\.sqlite"):
        open_database(str(path))
    assert path.read_bytes().startswith(b"not a database")


@pytest.mark.parametrize("opened", [lambda url: open_database(url, create=False), read_database])
def test_a_database_that_is_away_is_named_without_an_option_of_some_command(tmp_path, opened):
    with pytest.raises(UserError, match=r"nosuch\.sqlite: no such file") as caught:
        opened(str(tmp_path / "nosuch.sqlite"))
    assert " --" not in str(caught.value)  # the name came with --power, or from a configuration
