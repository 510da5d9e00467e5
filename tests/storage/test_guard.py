"""Rows go into the database that was opened at the start, and nowhere else; a commit is on disk."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import sqlite3
import subprocess
import sys

import pytest
import sqlalchemy as sa

from acqd.errors import UserError
from acqd.storage.away import DatabaseAwayError
from acqd.storage.database import engine_for, open_database, prepare, read_database, transaction
from acqd.storage.received import Received
from acqd.storage.schema import database_state, metadata, power_event
from acqd.storage.writer import Writer
from acqd.telemetry.register_row import register_row
from tests.storage.rows import count, message, row
from tests.storage.test_events import event, sent
from tests.storage.test_register_rows import received, summary


def test_a_file_that_was_moved_away_takes_no_row_and_is_used_again_when_it_is_back(tmp_path):
    path, away = tmp_path / "a.sqlite", tmp_path / "rotated.sqlite"
    writer = Writer(open_database(str(path)))
    writer.write([message(row(0))])
    path.rename(away)
    for k in range(3):
        with pytest.raises(DatabaseAwayError, match="moved away or deleted"):
            writer.write([message(row(1 + k))])
    assert not path.exists(), "no empty file takes its place"
    away.rename(path)
    writer.write([message(row(1))])
    assert count(open_database(str(path))) == 2 and not writer.guard.restored


@pytest.mark.parametrize("opened", [open_database, read_database])
def test_whoever_connects_while_the_file_is_away_makes_none_and_leaves_the_log_with_its_rows(tmp_path, opened):
    """SQLite makes an empty file, and deletes the log that is there beside an empty file."""
    path, away = tmp_path / "a.sqlite", tmp_path / "rotated.sqlite"
    writer = Writer(open_database(str(path)))
    writer.write([message(row(0))])
    other = opened(str(path))
    other.dispose()
    path.rename(away)
    with pytest.raises(sa.exc.OperationalError, match="unable to open"):
        other.connect()
    assert not path.exists() and path.with_name("a.sqlite-wal").stat().st_size
    away.rename(path)
    writer.write([message(row(1))])
    assert count(other) == 2 and not writer.guard.restored


def test_a_start_without_the_file_but_with_its_log_waits_for_the_file(tmp_path):
    path, away = tmp_path / "a.sqlite", tmp_path / "rotated.sqlite"
    engine = open_database(str(path))
    Writer(engine).write([message(row(0))])
    path.rename(away)
    with pytest.raises(DatabaseAwayError, match=r"a\.sqlite-wal holds rows: moved away\? Put it back"):
        open_database(str(path))
    away.rename(path)
    assert count(open_database(str(path))) == 1
    for file in (path, path.with_name("a.sqlite-wal")):
        file.unlink()
    assert count(open_database(str(path))) == 0, "a person has deleted both"


def test_a_viewer_that_is_idle_neither_stays_with_an_old_file_nor_keeps_the_sink_from_a_new_log(tmp_path):
    """Its index of the log would be the index of a log that is gone: disk I/O error for everybody."""
    path = tmp_path / "a.sqlite"
    writer = Writer(open_database(str(path)))
    writer.write([message(row(0))])
    viewers = read_database(str(path)), open_database(str(path), create=False, hold=False)
    assert [count(viewer) for viewer in viewers] == [1, 1]
    path.with_name("a.sqlite-wal").unlink()
    with pytest.raises(DatabaseAwayError, match="write-ahead log"):
        writer.write([message(row(1))])
    writer.write([message(row(1))])
    assert [count(viewer) for viewer in viewers] == [2, 2]
    backup = tmp_path / "b.sqlite"
    open_database(str(backup)).dispose()
    for suffix in ("-wal", "-shm"):
        path.with_name(f"a.sqlite{suffix}").unlink()
    backup.replace(path)
    assert [count(viewer) for viewer in viewers] == [0, 0]


def test_a_backup_that_was_put_back_gets_the_rows_that_it_lacks(tmp_path):
    path, backup = tmp_path / "a.sqlite", tmp_path / "backup.sqlite"
    engine = open_database(str(path))
    writer = Writer(engine)
    writer.write([message(row(0))])
    with sa.create_engine(f"sqlite:///{path}").connect() as connection:
        connection.exec_driver_sql(f"VACUUM INTO '{backup}'")
    for k in range(1, 4):
        writer.write([message(row(k))])
    for file in tmp_path.glob("a.sqlite*"):
        file.unlink()
    shutil.copy(backup, path)
    for attempt in range(3):
        try:
            writer.write([message(row(9))])
            break
        except DatabaseAwayError as error:
            assert "replaced" in error.reason and attempt < 2
    assert writer.guard.restored == 1 and count(open_database(str(path))) == 2
    writer.write([message(row(10))])
    assert writer.guard.restored == 1


def test_another_database_and_an_empty_one_are_named_and_take_no_row(database):
    engine = open_database(database)
    writer = Writer(engine)
    writer.write([message(row(0))])
    with transaction(engine) as connection:
        connection.execute(sa.update(database_state).where(database_state.c.key == "identity").values(value="x"))
    with pytest.raises(DatabaseAwayError, match="another database"):
        writer.write([message(row(1))])
    with transaction(engine) as connection:
        connection.exec_driver_sql("DROP TABLE database_state")
    with pytest.raises(DatabaseAwayError, match="its tables are gone"):
        writer.write([message(row(1))])
    assert count(engine) == 1


def test_daemons_send_again_what_a_new_database_lacks_once(database):
    """A server failed over to an empty replica, and the sink was restarted to make tables there."""
    first = Writer(open_database(database))
    first.write([message(row(0))])
    first.write([message(row(1))])
    assert first.guard.recall == 1 and not first.guard.restored
    for client_id in ("acqd-sink", "another of a group"):
        again = Writer(open_database(database), client_id=client_id)
        again.write([message(row(2))])
        assert not again.guard.recall


def test_a_command_makes_no_tables_in_an_empty_replica(postgres):
    with pytest.raises(UserError, match="has no tables of acqd: empty"):
        open_database(postgres, create=False)
    with engine_for(postgres).connect() as connection:
        assert not sa.inspect(connection).get_table_names()
    open_database(postgres)
    assert open_database(postgres, create=False)


@pytest.mark.parametrize("mode", ["DELETE", "WAL"])
@pytest.mark.parametrize("table", ["cars", "power"])
def test_a_command_leaves_the_file_of_another_program_as_it_is(tmp_path, table, mode):
    path = tmp_path / "other.sqlite"
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute(f"PRAGMA journal_mode={mode}")
        connection.execute(f"CREATE TABLE {table} (a)")
    before = path.read_bytes()
    with pytest.raises(UserError, match="has no tables of acqd"):
        open_database(str(path), create=False)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("mode", ["DELETE", "WAL"])
def test_a_viewer_changes_no_file(tmp_path, mode):
    path = tmp_path / "other.sqlite"
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute(f"PRAGMA journal_mode={mode}")
        connection.execute("CREATE TABLE power (a)")
    before = path.read_bytes()
    engine = read_database(str(path))
    with engine.connect() as connection:
        assert not connection.exec_driver_sql("SELECT * FROM power").all()
        with pytest.raises(sa.exc.OperationalError, match="readonly"):
            connection.exec_driver_sql("DELETE FROM power")
    engine.dispose()
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_a_viewer_of_a_server_changes_nothing(postgres):
    open_database(postgres).dispose()
    with read_database(postgres).connect() as connection, pytest.raises(sa.exc.DBAPIError, match="read-only"):
        connection.exec_driver_sql("DELETE FROM power")


def test_a_sink_names_the_table_of_another_program(tmp_path):
    with contextlib.closing(sqlite3.connect(tmp_path / "other.sqlite")) as connection:
        connection.execute("CREATE TABLE power (a)")
    with pytest.raises(UserError, match="power already exists; is it another program's database"):
        open_database(str(tmp_path / "other.sqlite"))


def test_a_commit_of_the_sink_is_on_the_disk_before_it_returns(tmp_path):
    """The log is synchronised at every commit: strace is not everywhere, so the setting of the connection is asked."""
    engine = engine_for(str(tmp_path / "a.sqlite"), impatient=True)
    prepare(engine)
    with engine.connect() as connection:
        assert connection.exec_driver_sql("PRAGMA synchronous").scalar() == 2
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"


def test_a_killed_writer_leaves_what_it_committed(tmp_path):
    path = tmp_path / "a.sqlite"
    program = (
        "import os, sys\nfrom acqd.storage.database import open_database\nfrom acqd.storage.writer import Writer\n"
        "from tests.storage.rows import message, row\n"
        f"writer = Writer(open_database({str(path)!r}))\nwriter.write([message(row(k)) for k in range(50)])\n"
        "os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=False, env=dict(os.environ))
    assert count(open_database(str(path))) == 50


@pytest.mark.parametrize("error", [errno.ESTALE, errno.EIO])
def test_a_share_that_does_not_say_whether_the_file_is_there_is_waited_for(tmp_path, monkeypatch, error):
    writer, real, away = Writer(open_database(str(tmp_path / "a.sqlite"))), os.stat, []
    writer.write([message(row(0))])

    def stat(path, *args, **names):
        if away and str(path).endswith("a.sqlite"):
            raise OSError(error, os.strerror(error))
        return real(path, *args, **names)

    monkeypatch.setattr(os, "stat", stat)
    away.append(True)
    with pytest.raises(DatabaseAwayError, match=os.strerror(error)):
        writer.write([message(row(1))])
    away.clear()
    writer.write([message(row(1))])
    assert count(open_database(str(tmp_path / "a.sqlite"))) == 2


DROPS = {
    "sqlite": (["CREATE TRIGGER d BEFORE {what} BEGIN SELECT RAISE(IGNORE); END"], "DROP TRIGGER d"),
    "postgresql": (
        [
            "CREATE FUNCTION d() RETURNS trigger LANGUAGE plpgsql AS 'BEGIN RETURN NULL; END'",
            "CREATE TRIGGER d BEFORE {what} FOR EACH ROW EXECUTE FUNCTION d()",
        ],
        "DROP FUNCTION d CASCADE",
    ),
}
KINDS = {
    "power": [message(row(k)) for k in range(3)],
    "power_register": [received(register_row(summary(60 * k))) for k in range(3)],
    "power_event": [sent(event(0)), sent(event(1)), sent(event(1)), sent(event(2, duration=None))],
    "quarantine": [Received("acqd/cell1/L1/power", b"no row %d" % k) for k in range(3)],
}
"""Messages for each table; the first one is there already when a trigger comes."""
NUMBERED = {"power": "power_row"}
"""SQLite keeps rows under another name."""


@pytest.mark.parametrize("table", KINDS)
def test_rows_that_the_database_drops_without_an_error_have_no_receipt(database, table):
    engine = open_database(database)
    writer, kind = Writer(engine), KINDS[table]
    begin, end = DROPS[engine.dialect.name]
    name = NUMBERED.get(table, table) if engine.dialect.name == "sqlite" else table
    writer.write(kind[:1])
    with engine.begin() as connection:
        for statement in begin:
            connection.exec_driver_sql(statement.format(what=f"INSERT ON {name}"))
    if table in ("power", "power_register"):
        with pytest.raises(DatabaseAwayError, match="leaves out rows"):
            writer.write(kind[1:])
        written = writer.write(kind)  # a row that is there already takes another way, and has its receipt
        assert sum(len(ranges) for ranges in written.receipts.values()) == 1
    else:
        assert not any(map(len, writer.write(kind[1:]).receipts.values()))
    assert "leaves out rows" in writer.refusals.trouble
    writer.write(kind[:1])  # the same again is no new row
    with engine.begin() as connection:
        connection.exec_driver_sql(end)
    writer.write(kind)
    assert count(engine, metadata.tables[table]) == 3


def test_a_change_of_its_own_marks_that_the_database_drops_is_no_commit(database):
    """The number of the commit stays behind, which would look like a database that was put back."""
    engine = open_database(database)
    writer = Writer(engine)
    writer.write([sent(event(duration=None)), message(row(0))])
    begin, end = DROPS[engine.dialect.name]
    with engine.begin() as connection:
        for statement in begin:
            connection.exec_driver_sql(statement.format(what="UPDATE ON database_state"))
    for _ in range(2):
        with pytest.raises(DatabaseAwayError, match="leaves out rows"):
            writer.write([sent(event()), message(row(1))])
    with engine.begin() as connection:
        connection.exec_driver_sql(end)
    assert writer.write([sent(event()), message(row(1))]).rows == 1 and not writer.guard.restored


def test_an_end_of_an_event_that_the_database_drops_has_no_receipt_and_rows_are_stored(database):
    engine = open_database(database)
    writer = Writer(engine)
    writer.write([sent(event(duration=None)), message(row(0))])
    begin, end = DROPS[engine.dialect.name]
    with engine.begin() as connection:
        for statement in begin:
            connection.exec_driver_sql(statement.format(what="UPDATE ON power_event"))
    written = writer.write([sent(event()), message(row(1))])
    assert [stream.channel for stream in written.receipts] == ["L1"] and count(engine) == 2
    with engine.begin() as connection:
        connection.exec_driver_sql(end)
    assert len(writer.write([sent(event())]).receipts) == 1


@pytest.mark.parametrize("index", ["", "CREATE UNIQUE INDEX ON part (device, boot, {})"])
@pytest.mark.parametrize("table", KINDS)
def test_rows_that_a_trigger_puts_into_a_part_of_the_table_are_stored_once(postgres, table, index):
    engine = open_database(postgres)
    writer, kind = Writer(engine), KINDS[table]
    first = [sent(event(1, duration=None))] if table == "power_event" else []  # its end comes behind the trigger
    writer.write(kind[:1])
    numbers = {"power_event": "number", "quarantine": ""}.get(table, "channel, seq")
    with engine.begin() as connection:
        for statement in (
            f"CREATE TABLE part () INHERITS ({table})",
            "CREATE FUNCTION d() RETURNS trigger LANGUAGE plpgsql AS"
            " 'BEGIN INSERT INTO part VALUES (NEW.*); RETURN NULL; END'",
            f"CREATE TRIGGER d BEFORE INSERT ON {table} FOR EACH ROW EXECUTE FUNCTION d()",
            *filter(None, [index.format(numbers) if numbers else ""]),
        ):
            connection.exec_driver_sql(statement)
    for batch in ([*first, *kind[1:2]], kind[1:2], [*kind, kind[-1]]):  # new; sent again; some new, one comes twice
        writer.write(batch)
    assert count(engine, metadata.tables[table]) == 3
    if table == "power_event":
        with engine.connect() as connection:
            ends = connection.execute(sa.select(power_event.c.duration).order_by(power_event.c.number)).scalars().all()
        assert ends == [0.1, 0.1, None]


def test_a_mark_that_somebody_has_written_over_is_not_counted_on(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(row(0))])
    for text in ("[" + "9" * 30 + ',0,"00",0]', "[" * 5000, '[-1,-1,"",0]', "5"):
        with engine.begin() as connection:
            connection.execute(database_state.update().where(database_state.c.key != "identity").values(value=text))
        assert Writer(engine).write([message(row(1))]).rows == 1


@pytest.mark.parametrize("name", ["a.sqlite", "link.sqlite"])
@pytest.mark.parametrize("suffixes", [["-wal"], ["-wal", "-shm"]])
def test_a_log_that_was_deleted_costs_no_row(tmp_path, suffixes, name):
    """Somebody takes it for rubbish: SQLite would go on to write into a file without a name."""
    path = tmp_path / "disk" / "a.sqlite"
    path.parent.mkdir()
    (tmp_path / "link.sqlite").symlink_to(path)  # SQLite has the log beside the file, not beside the link
    writer = Writer(open_database(str(path.with_name(name) if name == path.name else tmp_path / name)))
    writer.write([message(row(0))])
    writer.write([message(row(1))])
    for suffix in suffixes:
        path.with_name(f"a.sqlite{suffix}").unlink()
    with pytest.raises(DatabaseAwayError, match=r"log .* was deleted"):
        writer.write([message(row(2))])
    writer.write([message(row(2))])
    assert count(open_database(str(path))) == 3 and not writer.guard.restored


def with_a_log(folder):
    """A database whose tables are in the file, the place of its log, a writer, and the writer's engine."""
    path = folder / "a.sqlite"
    engine = open_database(str(path))
    engine.dispose()
    return path, path.with_name("a.sqlite-wal"), Writer(engine), engine


def assert_sound(path):
    with contextlib.closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)


@pytest.mark.parametrize("viewed", [False, True])
@pytest.mark.parametrize("left", [0.0, 0.5, 1.0])
def test_a_log_that_was_cut_off_is_noticed_before_a_receipt_and_what_it_lacks_is_asked_for(tmp_path, left, viewed):
    """`truncate`, or a rotation of logs that copies and truncates: SQLite would go on behind the hole."""
    path, log, writer, _ = with_a_log(tmp_path)
    writer.write([message(row(k)) for k in range(100)])
    viewer = read_database(str(path))
    seen = viewer.connect() if viewed else None  # keeps the index of the log, and with it what SQLite believes of it
    if seen is not None:
        seen.exec_driver_sql("SELECT count(*) FROM power").scalar()
        seen.rollback()
    writer.write([message(row(100))])
    recalled = writer.guard.recall
    os.truncate(log, int(log.stat().st_size * left))
    if left < 1:
        with pytest.raises(DatabaseAwayError, match=r"\(-wal\) became shorter"):
            writer.write([message(row(101))])
    if seen is not None and left < 1:
        with pytest.raises(sa.exc.DBAPIError):
            writer.write([message(row(101))])
        seen.close()
    viewer.dispose()
    writer.write([message(row(101))])
    kept = count(open_database(str(path)))
    assert (writer.guard.recall > recalled) == (kept < 102) == (left < 1)
    writer.write([message(row(k)) for k in range(102)])
    assert count(open_database(str(path))) == 102
    assert_sound(path)


@pytest.mark.parametrize("left", [0.0, 0.6])
def test_rows_of_a_commit_that_leaves_a_hole_in_the_log_have_no_receipt(tmp_path, left):
    path, log, writer, engine = with_a_log(tmp_path)
    writer.write([message(row(k)) for k in range(100)])

    def cut(_):
        os.truncate(log, int(log.stat().st_size * left))

    sa.event.listen(engine, "commit", cut, once=True)
    with pytest.raises(DatabaseAwayError, match="cut off while"):
        writer.write([message(row(100))])
    writer.write([message(row(k)) for k in range(101)])
    assert count(open_database(str(path))) == 101
    assert_sound(path)


@pytest.mark.parametrize("restarted", [False, True])
@pytest.mark.parametrize("left", [0.0, 0.3, 0.6])
def test_a_log_that_is_cut_off_after_a_batch_that_is_most_of_it_is_noticed(tmp_path, left, restarted):
    """`restarted`: the batch has begun the log again, as SQLite does where the file has all of it."""
    path, log, writer, _ = with_a_log(tmp_path)
    if restarted:
        writer.write([message(row(k)) for k in range(600)])
        with contextlib.closing(sqlite3.connect(path)) as connection:
            connection.execute("PRAGMA wal_checkpoint")
    writer.write([message(row(k)) for k in range(600, 1200)])
    os.truncate(log, int(log.stat().st_size * left))
    with pytest.raises(DatabaseAwayError, match=r"\(-wal\) became shorter"):
        writer.write([message(row(1200))])
    writer.write([message(row(1200))])
    assert writer.guard.restored == 1 and count(open_database(str(path))) == (601 if restarted else 1)
    assert_sound(path)


def test_a_log_that_was_cut_off_takes_no_row_before_the_full_disk_takes_a_copy_of_it(tmp_path, monkeypatch):
    path = tmp_path / "a.sqlite"
    engine = open_database(str(path))
    engine.dispose()
    writer = Writer(engine)
    writer.write([message(row(k)) for k in range(100)])
    log, copied = path.with_name("a.sqlite-wal"), shutil.copyfile

    def full(source, target):
        copied(source, target)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(shutil, "copyfile", full)
    sa.event.listen(engine, "commit", lambda _: os.truncate(log, int(log.stat().st_size * 0.6)), once=True)
    for _ in range(3):
        with pytest.raises(DatabaseAwayError, match=r"cut off while .* No space left on device"):
            writer.write([message(row(100))])
    assert not list(tmp_path.glob("*.cut"))
    monkeypatch.undo()
    with pytest.raises(DatabaseAwayError, match="cut off while"):
        writer.write([message(row(100))])
    writer.write([message(row(k)) for k in range(101)])
    assert count(open_database(str(path))) == 101
    assert_sound(path)
