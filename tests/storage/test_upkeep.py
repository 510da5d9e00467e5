"""The thread that keeps the database in order beside the sink."""

from __future__ import annotations

import re
import time

import pytest
import sqlalchemy as sa

from acqd.cli.sink import _costs
from acqd.daemon.config import Config
from acqd.daemon.energy_section import EnergySection
from acqd.daemon.health.runbook import entry_for
from acqd.errors import UserError
from acqd.storage import conversion, upkeep
from acqd.storage.database import open_database, transaction
from acqd.storage.maintain import Retention
from acqd.storage.retention_doubt import last_run
from acqd.storage.schema import power_1min, power_15min, quarantine
from acqd.storage.upkeep import Upkeep
from acqd.storage.writer import Writer
from acqd.telemetry.row import CHANNELS
from tests.storage.rows import T0, count, message, row
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


def test_a_clock_in_doubt_is_said_once_although_the_sentence_names_the_time(tmp_path, caplog):
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(row(0))])
    thread, ahead = Upkeep(engine, Retention(power_days=30.0)), T0 + 40 * 86_400
    for seconds in (0, 90, 3_600):
        assert not thread.run_if_due(lambda now=ahead + seconds: now)
    assert caplog.text.count("nothing was deleted") == 1 and "nothing was deleted" in thread.trouble


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


def test_copies_of_refused_rows_come_back_when_the_table_takes_them(tmp_path):
    """Also those that nobody sends again."""
    engine = open_database(str(tmp_path / "a.sqlite"))
    writer = Writer(engine)
    writer.write([message(row(0))])
    with engine.begin() as connection:
        connection.exec_driver_sql("CREATE TRIGGER d BEFORE INSERT ON power_row BEGIN SELECT RAISE(ABORT, 'x'); END")
    writer.write([message(row(k)) for k in range(1, 3)])
    thread = Upkeep(engine, Retention(0, 0, 0), refusals=writer.refusals)
    thread._restore_refused()
    writer.refusals._said.clear()  # none was refused lately
    thread._restore_refused()
    assert count(engine) == 1 and count(engine, quarantine) == 2 and writer.refusals.copies
    with engine.begin() as connection:
        connection.exec_driver_sql("DROP TRIGGER d")
    thread._restore_refused()
    assert count(engine) == 3 and not count(engine, quarantine) and not writer.refusals.copies and not thread.trouble


REFUSED_WHOLLY = (
    (
        "sqlite",
        "CREATE TRIGGER d BEFORE INSERT ON power_row WHEN NEW.id & 3 = {} BEGIN SELECT RAISE(IGNORE); END",
        "DROP TRIGGER d",
    ),
    (
        "postgres",
        "CREATE FUNCTION d() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN IF NEW.channel = 'L2' THEN RAISE 'no right' "
        "USING ERRCODE = '42501'; END IF; RETURN NEW; END $$; "
        "CREATE TRIGGER d BEFORE INSERT ON power FOR EACH ROW EXECUTE FUNCTION d()",
        "DROP FUNCTION d CASCADE",
    ),
)


@pytest.mark.parametrize(
    ("database", "begin", "end"), REFUSED_WHOLLY, indirect=["database"], ids=["sqlite", "postgres"]
)
def test_copies_that_the_table_may_refuse_as_a_whole_are_named_and_tried_again(database, begin, end, caplog):
    """Nobody sends these rows again, so nothing else would say that they wait."""
    engine = open_database(database)
    writer = Writer(engine)
    with engine.begin() as connection:
        connection.exec_driver_sql(begin.format(CHANNELS.index("L2")))
    assert writer.write([message(row(0)), message(row(0, channel="L2"))]).waiting == 1
    writer.refusals._said.clear()  # none was refused lately
    thread = Upkeep(engine, Retention(0, 0, 0), refusals=writer.refusals)
    for _ in range(2):
        thread._try(upkeep._REFUSED, thread._restore_refused)
        assert re.search(r"refused rows: .*(no right|leaves out).* copies wait in quarantine", thread.trouble)
    entry = entry_for(f"costs: x; {thread.trouble}")
    assert entry is not None and entry.anchor == "rows-refused" and "error of acqd" not in caplog.text
    with engine.begin() as connection:
        connection.exec_driver_sql(end)
    thread._try(upkeep._REFUSED, thread._restore_refused)
    assert count(engine) == 2 and not count(engine, quarantine) and not thread.trouble


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


def test_costs_that_fail_are_a_trouble_of_their_own_and_end_nothing(tmp_path, caplog):
    engine = open_database(str(tmp_path / "a.sqlite"))
    locked = sa.exc.DBAPIError("", (), OSError("locked"))
    errors = [OverflowError("too large"), UserError("prices.csv: expected a header"), locked]
    seen = []

    def costs(_):
        seen.append(thread.trouble)
        if errors:
            raise errors.pop(0)
        return 0

    thread = Upkeep(engine, Retention(0, 0, 0), costs)
    thread.start()
    wait_for(lambda: len(seen) > 5, "further looks")
    thread.stop()
    assert [one.partition(";")[0] for one in seen[:5]] == [
        "", "costs: OverflowError: too large", "costs: prices.csv: expected a header", "costs: locked", "",
    ]  # fmt: skip
    assert not thread.trouble and last_run(engine) is not None and caplog.text.count("Traceback") == 1


def test_a_lock_that_is_over_is_no_trouble_any_more(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    thread = Upkeep(engine, Retention(0, 0, 0))
    assert thread.run_if_due()
    thread._say("maintenance", "database is locked; trying again")
    assert not thread.run_if_due() and not thread.trouble


def test_a_disk_that_fails_for_a_moment_is_a_trouble_until_the_next_look(tmp_path, monkeypatch):
    """Before the first maintenance is due, too."""
    monkeypatch.setattr(upkeep, "_FIRST_S", 600.0)
    engine, errors = open_database(str(tmp_path / "a.sqlite")), [OSError(5, "Input/output error")]
    seen = []

    def convert(*_):
        seen.append(thread.trouble)
        if errors:
            raise errors.pop()
        return 0

    monkeypatch.setattr(upkeep, "convert", convert)
    thread = Upkeep(engine, Retention(0, 0, 0))
    thread.start()
    wait_for(lambda: len(seen) > 2, "further looks")
    thread.stop()
    assert "Input/output error" in seen[1] and not seen[2]


def test_a_broken_tariff_does_not_stop_the_sink(tmp_path):
    (tmp_path / "t.toml").write_text("price = ")
    engine = open_database(str(tmp_path / "a.sqlite"))
    start = int(time.time()) // 900 * 900 - 7200
    rows = [{"device": "a", "channel": "total", "start": start + 900 * k, "rows": 22_500, "P": 1000.0,
             "P_min": 1000.0, "P_max": 1000.0, "W": k / 4, "flagged": 0} for k in range(4)]  # fmt: skip
    with transaction(engine) as connection:
        connection.execute(sa.insert(power_15min), rows)
    costs = _costs(Config(energy=EnergySection(tariff=tmp_path / "t.toml")))
    with pytest.raises(UserError, match=r"t\.toml"):
        costs(engine)
    (tmp_path / "t.toml").write_text("price = 0.5\n")
    assert costs(engine) == 3
