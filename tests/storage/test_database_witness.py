"""A database that was put back while the sink was stopped is noticed at the next start; healthy starts are not."""

from __future__ import annotations

import json
import os
import shutil
from types import SimpleNamespace

import pytest
import sqlalchemy as sa

from acqd.storage.database import open_database
from acqd.storage.database_witness import DatabaseWitness
from acqd.storage.maintain import Retention, maintain
from acqd.storage.schema import database_state
from acqd.storage.sink import Sink
from acqd.storage.sink_settings import SinkSettings
from acqd.storage.state import commits
from acqd.storage.writer import Writer
from acqd.telemetry.earlier_state import CommitsHeard
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.receipts import Receipt
from tests.storage.rows import T0, count, message, row

SINK = "acqd-sink-x/1"
KEY = commits(SINK)


def run(url, state_dir, *seqs, client_id=SINK):
    """A sink from its start to its end; its guard."""
    engine = open_database(str(url))
    writer = Writer(engine, client_id=client_id, memory=DatabaseWitness(state_dir, client_id))
    for seq in seqs:
        writer.write([message(row(seq))])
    writer.guard.close()
    engine.dispose()
    return writer.guard


def marks(engine):
    with engine.connect() as connection:
        return connection.execute(sa.select(database_state).where(database_state.c.key != "identity")).all()


def test_an_older_copy_that_was_put_back_while_the_sink_was_stopped_is_named_once(database, tmp_path, caplog):
    run(database, tmp_path, 0)
    engine = open_database(database)
    older = marks(engine)
    assert run(database, tmp_path, 1, 2).restored == 0
    with engine.begin() as connection:
        for key, value in older:
            changed = sa.update(database_state).where(database_state.c.key == key).values(value=value)
            connection.execute(changed)
    again = run(database, tmp_path, 1)
    assert (again.restored, again.recall) == (1, 1) and "in an earlier state" in caplog.text
    named = again.recalled
    again = run(database, tmp_path, 2)
    assert (again.restored, again.recall) == (0, 0)
    assert again.recalled == named, "daemons that were away meanwhile find it when they come back"


def put_back(here, snapshot):
    shutil.rmtree(here)
    shutil.copytree(snapshot, here)


def heard(commits):
    """What a daemon learns from the receipts of these sinks, one after another."""
    said = CommitsHeard()
    return [said.gone_back(Receipt(SINK, [], commits=one)) for one in commits]


def test_receipts_show_a_computer_that_was_put_back_as_a_whole(tmp_path):
    """Database and file beside it agree then: only those who have heard of later commits can know."""
    here, early, late = tmp_path / "here", tmp_path / "early", tmp_path / "late"
    here.mkdir()
    said = [run(here / "a.sqlite", here, 0, 1).commits]
    shutil.copytree(here, early)
    said += [run(here / "a.sqlite", here, seq).commits for seq in (2, 3, 4)]
    shutil.copytree(here, late)
    for seq, snapshot in enumerate((early, early, late, late), start=5):
        put_back(here, snapshot)
        guard = run(here / "a.sqlite", here, seq)
        assert guard.restored == 0
        said += [guard.commits, run(here / "a.sqlite", here, 20 + seq).commits]
    assert heard(said) == [False] * 4 + [True, False] * 4
    assert said[0].now == 3 and said[-1].after == said[-2].run


def test_a_later_copy_under_a_running_sink_shows_in_receipts(database):
    """Its number is greater, so the sink takes the commits for those of another sink of its name."""
    engine = open_database(database)
    later = Writer(engine, client_id=SINK)
    writers = [Writer(engine, client_id=SINK)]
    writers[0].write([message(row(0))])
    before = marks(engine)
    later.write([message(row(1))])
    after = marks(engine)
    said = [writers[0].guard.commits, later.guard.commits]
    for key, value in before:
        with engine.begin() as connection:
            connection.execute(sa.update(database_state).where(database_state.c.key == key).values(value=value))
    writers.append(Writer(engine, client_id=SINK))
    writers[1].write([message(row(2))])
    said.append(writers[1].guard.commits)
    for key, value in after:
        with engine.begin() as connection:
            connection.execute(sa.update(database_state).where(database_state.c.key == key).values(value=value))
    writers[1].write([message(row(3))])
    said.append(writers[1].guard.commits)
    assert heard(said) == [False, False, True, True]


def test_what_the_sink_has_found_itself_is_said_once(database, tmp_path):
    said = [run(database, tmp_path, 0).commits]
    engine = open_database(database)
    older = marks(engine)
    said.append(run(database, tmp_path, 1, 2).commits)
    with engine.begin() as connection:
        for key, value in older:
            connection.execute(sa.update(database_state).where(database_state.c.key == key).values(value=value))
    again = run(database, tmp_path, 1)
    assert again.restored == 1
    said += [again.commits, run(database, tmp_path, 3).commits]
    assert heard(said) == [False] * 4


def test_a_copy_from_before_the_first_commit_of_the_sink_lacks_rows_too(tmp_path):
    path, older = tmp_path / "a.sqlite", tmp_path / "older.sqlite"
    run(path, tmp_path, 0, client_id="another")
    shutil.copy(path, older)
    run(path, tmp_path, 1, 2)
    for file in tmp_path.glob("a.sqlite*"):
        file.unlink()
    older.rename(path)
    assert run(path, tmp_path, 3).restored == 1
    path.unlink()
    assert (run(path, tmp_path, 3).restored, count(open_database(str(path)))) == (0, 1), "a new one is no older state"


def vacuum(path, _):
    with sa.create_engine(f"sqlite:///{path}").connect() as connection:
        connection.exec_driver_sql("VACUUM")


def old_rows_deleted(path, _):
    maintain(open_database(str(path)), Retention(1, 1, 1), T0 + 10 * 86_400)
    assert not count(open_database(str(path)))


def promoted(path, _):
    """A replica that has all commits, under the same name."""
    shutil.copy(path, f"{path}.replica")
    os.replace(f"{path}.replica", path)


def another_in_between(path, state_dir):
    run(path.with_name("b.sqlite"), state_dir, 0)


def backup_with_its_state(path, state_dir):
    """`acqd service restore` puts the folder of the state back together with the database."""
    backup = path.with_name("backup")
    shutil.copytree(state_dir, backup / "state")
    shutil.copy(path, backup / "a.sqlite")
    run(path, state_dir, 7, 8, 9)
    shutil.rmtree(state_dir)
    shutil.copytree(backup / "state", state_dir)
    shutil.copy(backup / "a.sqlite", path)


def no_memory(_, state_dir):
    shutil.rmtree(state_dir)


def garbage(_, state_dir):
    for file in state_dir.glob("sink-*.json"):
        file.write_bytes(b'{"x": []}')


def pipe(_, state_dir):
    for file in state_dir.glob("sink-*.json"):
        file.unlink()
        os.mkfifo(file)


def another_sink(path, state_dir):
    run(path, state_dir, 5, 6, client_id="another")


HEALTHY = [
    vacuum, old_rows_deleted, promoted, another_in_between, backup_with_its_state, no_memory, garbage, pipe,
    another_sink,
]  # fmt: skip


@pytest.mark.parametrize("between", [lambda *_: None, *HEALTHY])
def test_what_happens_between_healthy_starts_is_no_older_state(tmp_path, between):
    path, state_dir = tmp_path / "a.sqlite", tmp_path / "state"
    state_dir.mkdir()
    run(path, state_dir, 0, 1, 2)
    between(path, state_dir)
    again = run(path, state_dir, 3)
    assert (again.restored, again.recall) == (0, 0)


def test_a_kill_leaves_a_number_that_is_too_small_and_no_alarm(tmp_path):
    now = [0.0]
    memory = DatabaseWitness(tmp_path, SINK, lambda: now[0])
    for number in range(1, 9):
        now[0] += 0.3
        memory.committed("x", number)
    assert 0 < DatabaseWitness(tmp_path, SINK).number("x") <= 8
    memory.committed("x", 3)
    assert DatabaseWitness(tmp_path, SINK).number("x") == 3
    for k in range(40):
        memory.committed(f"another {k}", 1)
    memory.write()
    assert len(DatabaseWitness(tmp_path, SINK)._numbers) == 32 and not DatabaseWitness(tmp_path, SINK).number("x")


def test_a_folder_that_takes_no_file_stops_no_row_and_is_said_once(tmp_path, caplog):
    guard = run(tmp_path / "a.sqlite", tmp_path / "missing", 0, 1, 2)
    assert not guard.restored and count(open_database(str(tmp_path / "a.sqlite"))) == 3
    assert caplog.text.count("will not be noticed") == 1


def test_a_recall_whose_commit_fails_is_named_by_the_next_one(database, tmp_path):
    engine = open_database(database)
    writer = Writer(engine, client_id=SINK)
    with pytest.raises(RuntimeError), writer.guard.transaction():
        raise RuntimeError
    name = writer.guard.recalled
    writer.write([message(row(0))])
    assert name and run(database, tmp_path, 1).recalled == writer.guard.recalled


def set_number(engine, number):
    """As an older copy has it."""
    with engine.begin() as connection:
        text = connection.execute(sa.select(database_state.c.value).where(database_state.c.key == KEY)).scalar_one()
        older = json.dumps([number, *json.loads(text)[1:]])
        connection.execute(sa.update(database_state).where(database_state.c.key == KEY).values(value=older))


def test_the_announcement_names_the_recall_of_an_earlier_start_and_asks_once(tmp_path):
    url, said = str(tmp_path / "a.sqlite"), []
    earlier = Writer(open_database(url), client_id=SINK)
    earlier.write([message(row(0))])
    sink = Sink(BrokerAddress("127.0.0.1", 1), open_database(url), SinkSettings(client_id=SINK))
    sink._announced = True
    connection = SimpleNamespace(publish=lambda topic, content, retain: said.append(json.loads(content)))
    committer = SimpleNamespace(done=list, trouble="", returns=0, waits_s=0.0)
    for seq in (1, 2):
        sink._writer.write([message(row(seq))])
        sink._answer(connection, committer)
    set_number(sink._engine, 1)
    for seq in (3, 4):
        sink._writer.write([message(row(seq))])
        sink._answer(connection, committer)
    first, second = said
    assert first["recalled"] == earlier.guard.recalled and "recall" not in first
    assert second["recall"] and second["recalled"] not in ("", first["recalled"])
