"""The thread that keeps the database in order beside the sink."""

from __future__ import annotations

import pytest

from acqd.storage import conversion, upkeep
from acqd.storage.database import open_database
from acqd.storage.maintain import Retention
from acqd.storage.retention_doubt import last_run
from acqd.storage.schema import power_1min
from acqd.storage.upkeep import Upkeep
from acqd.storage.writer import Writer
from tests.storage.rows import count, message, row
from tests.storage.test_numbered_rows import earlier  # noqa: F401 - a fixture
from tests.waiting import wait_for


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    monkeypatch.setattr(upkeep, "_LOOK_S", 0.01)
    monkeypatch.setattr(upkeep, "_FIRST_S", 0.0)


def test_the_thread_makes_roll_ups_once_and_ends_when_it_is_told(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(row(0))])
    thread = Upkeep(engine, Retention(0, 0, 0))
    thread.start()
    wait_for(lambda: last_run(engine) is not None, "a run")
    first = last_run(engine)
    wait_for(lambda: len(thread._free) > 5, "further looks")
    thread.stop()
    assert count(engine, power_1min) == 1 and last_run(engine) == first and not thread.trouble
    assert not thread._thread.is_alive()


def test_a_database_that_is_away_is_a_trouble_until_it_is_back(tmp_path, caplog):
    engine = open_database(str(tmp_path / "a.sqlite"))
    with engine.connect() as connection:
        connection.exec_driver_sql("ALTER TABLE database_state RENAME TO hidden")
    thread = Upkeep(engine, Retention(0, 0, 0))
    thread.start()
    wait_for(lambda: "no such table" in thread.trouble, "the trouble")
    with engine.connect() as connection:
        connection.exec_driver_sql("ALTER TABLE hidden RENAME TO database_state")
    wait_for(lambda: not thread.trouble, "the end of it")
    thread.stop()
    assert caplog.text.count("no such table") == 1, "said once"


def test_the_thread_moves_the_rows_of_an_earlier_acqd(earlier, tmp_path, monkeypatch):  # noqa: F811
    monkeypatch.setattr("acqd.storage.database._CONVERTED_AT_ONCE", 0)
    monkeypatch.setattr(conversion, "_AT_ONCE", 2)
    monkeypatch.setattr(upkeep, "_AT_ONCE", 2)
    monkeypatch.setattr(upkeep, "_BETWEEN_S", 0.0)
    engine, rows = open_database(str(tmp_path / "a.sqlite")), earlier[1]

    def unfinished():
        with engine.connect() as connection:
            return conversion.unfinished(connection)

    assert unfinished()
    thread = Upkeep(engine, Retention(0, 0, 0))
    thread.start()
    wait_for(lambda: not unfinished(), "all rows are moved")
    thread.stop()
    assert count(engine) == len(rows)
