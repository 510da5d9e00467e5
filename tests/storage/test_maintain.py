"""Roll-ups and retention."""

from __future__ import annotations

import json
import time
from contextlib import contextmanager

import pytest
import sqlalchemy as sa

from acqd.storage.away import DatabaseAwayError
from acqd.storage.clock_witness import ClockWitness
from acqd.storage.database import open_database, transaction
from acqd.storage.maintain import Retention, maintain
from acqd.storage.received import Received
from acqd.storage.retention_doubt import doubt, note_run
from acqd.storage.schema import database_state, power, power_1min, power_15min, power_row, quarantine
from acqd.storage.writer import Writer
from acqd.uptime import Moment
from tests.commands import acqd_here
from tests.storage.rows import T0, count, message, row


def test_roll_ups_and_retention(database):
    engine = open_database(database)
    day = 86_400
    rows = [
        row(k, t=T0 + k * 2.0, W=0.001 * k, Vrms=230.0 + (k % 2), flags=["gap"] if k == 3 else []) for k in range(1_000)
    ]
    Writer(engine).write([message(r) for r in rows])
    now = T0 + 1_000 * 2.0
    first = maintain(engine, Retention(power_days=0), now)
    assert (first.rollup_1min, first.rollup_15min) == (33, 2)
    with engine.connect() as connection:
        minute = connection.execute(sa.select(power_1min).order_by(power_1min.c.start)).mappings().first()
        quarters = connection.execute(sa.select(power_15min).order_by(power_15min.c.start)).mappings().all()
    assert minute["start"] == T0 and minute["rows"] == 30 and minute["flagged"] == 1
    assert minute["P"] == pytest.approx(280.0) and minute["W"] == pytest.approx(0.029)
    assert minute["Vrms"] == pytest.approx(((230.0**2 + 231.0**2) / 2) ** 0.5)
    assert minute["PF"] == pytest.approx(280.0 / 288.1)
    assert [q["rows"] for q in quarters] == [450, 450]

    # A late row changes its bucket; running again changes nothing else.
    Writer(engine).write([message(row(5_000, t=T0 + 1.0, P=580.0))])
    maintain(engine, Retention(power_days=0), now)
    with engine.connect() as connection:
        minute = connection.execute(sa.select(power_1min).order_by(power_1min.c.start)).mappings().first()
    assert minute["rows"] == 31 and minute["P_max"] == 580.0

    # Deleting keeps the roll-ups.
    later = maintain(engine, Retention(power_days=1.0, rollup_1min_days=2.0), T0 + 950 + day)
    assert later.power_deleted == 451 and count(engine) == 550
    gone = maintain(engine, Retention(power_days=1.0, rollup_1min_days=2.0), T0 + 3 * day)
    assert count(engine) == 0 and gone.rollup_deleted == count(engine, power_1min) + gone.rollup_deleted
    assert count(engine, power_15min) == 3


def test_a_backlog_of_days_is_rolled_up_before_it_is_deleted(database):
    engine = open_database(database)
    day = 86_400
    now = T0 + 100 * day
    recent = [row(k, t=now - 3_600 + k) for k in range(200)]
    Writer(engine).write([message(r) for r in recent])
    maintain(engine, Retention(power_days=30), now)
    old = [row(k, t=T0 + 40 * day + k, device="cell2", Vrms=1e-200) for k in range(120)]
    Writer(engine).write([Received("acqd/cell2/L1/power", r.to_json()) for r in old])
    done = maintain(engine, Retention(power_days=30), now)
    assert done.power_deleted == 120
    with engine.connect() as connection:
        stored = connection.execute(sa.select(power_1min.c.rows).where(power_1min.c.device == "cell2")).scalars().all()
    assert stored == [60, 60]


def lots(engine, days=40, per_day=2):
    """Rows of many days until `T0` + `days`; the time of the newest [Unix s]."""
    at = [T0 + k * 86_400.0 / per_day for k in range(days * per_day)]
    Writer(engine, witness=ClockWitness(now_ns=lambda: int(at[-1] * 1e9))).write(
        [message(row(k, t=t)) for k, t in enumerate(at)]
    )
    return at[-1]


def test_a_run_is_many_short_transactions_in_which_a_sink_has_its_turn(tmp_path, monkeypatch):
    engine = open_database(str(tmp_path / "a.sqlite"))
    sink, day = Writer(engine), 86_400
    sink.write([message(row(k, t=T0 + 60.0 * k)) for k in range(120)])
    begun = []

    @contextmanager
    def counted(of):
        begun.append(sink.write([message(row(1_000 + len(begun), t=T0 + 40 * day))]).rows)
        with transaction(of) as connection:
            yield connection

    monkeypatch.setattr("acqd.storage.maintain.transaction", counted)
    done = maintain(engine, Retention(power_days=30), T0 + 40 * day)
    assert done.power_deleted == 120 and len(begun) >= 3 * 8, "a quarter hour in each, twice rolled up, once deleted"
    assert count(engine) == len(begun)


def test_rows_whose_roll_ups_the_database_drops_are_kept(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    now = lots(engine)
    with transaction(engine) as connection:
        connection.exec_driver_sql("CREATE TRIGGER d BEFORE INSERT ON power_1min BEGIN SELECT RAISE(IGNORE); END")
    before = count(engine)
    with pytest.raises(DatabaseAwayError, match="leaves out rows without an error"):
        maintain(engine, Retention(power_days=30), now)
    assert count(engine) == before


def test_rows_that_another_maintenance_deletes_meanwhile_are_no_trouble(database, monkeypatch):
    """Between the look for rows and the roll-up of them."""
    engine = open_database(database)
    now = lots(engine)

    @contextmanager
    def late(of):
        with transaction(of) as connection:
            connection.execute(sa.delete(power_rows))
        with transaction(of) as connection:
            yield connection

    power_rows = power if engine.dialect.name == "postgresql" else power_row
    monkeypatch.setattr("acqd.storage.maintain.transaction", late)
    assert maintain(engine, Retention(power_days=30), now).rollup_1min == 0


def test_a_clock_far_from_the_newest_row_deletes_nothing(database):
    engine = open_database(database)
    now = lots(engine)
    assert not doubt(engine, Retention(), now)
    for ahead in (40, 400, 1.5):
        assert "rows would be deleted" in doubt(engine, Retention(), now + ahead * 86_400)
    assert not doubt(engine, Retention(power_days=0), now + 40 * 86_400), "nothing would be deleted"
    with transaction(engine) as connection:  # as of a database that was copied without what the sink had noted
        connection.execute(sa.delete(database_state))
    for days, where in ((40, "40.0 days before"), (1.5, "1.5 days before")):
        assert f"the newest row is {where}" in doubt(engine, Retention(), now + days * 86_400)
    assert not doubt(engine, Retention(), now)


def test_a_clock_that_has_gone_further_than_the_computer_has_been_running_deletes_nothing(database):
    """The rows may be of the same computer, and as wrong as its clock."""
    engine = open_database(database)
    now = lots(engine)
    with transaction(engine) as connection:
        connection.execute(sa.delete(database_state).where(database_state.c.key.startswith("commits")))
    note_run(engine, now, Moment(b"start", 10**9))
    later = now + 20 * 86_400
    Writer(engine, witness=ClockWitness(now_ns=lambda: int(later * 1e9))).write([message(row(9_999, t=later))])
    with transaction(engine) as connection:
        connection.execute(sa.delete(database_state).where(database_state.c.key.startswith("commits")))
    assert "since the last maintenance" in doubt(engine, Retention(), later, Moment(b"start", 3_600 * 10**9))
    assert not doubt(engine, Retention(), later, Moment(b"start", 20 * 86_400 * 10**9))
    assert "since the last maintenance" in doubt(engine, Retention(), later, Moment(b"other", 10**9))


def test_a_clock_that_was_later_before_deletes_nothing_until_a_person_vouches_for_it(database):
    """It was years ahead once, and now it is 40 days ahead, with the daemons of the same computer."""
    engine = open_database(database)
    now = lots(engine)
    later = now + 14 * 365 * 86_400
    Writer(engine, witness=ClockWitness(now_ns=lambda: int(later * 1e9))).write([message(row(9_998, t=now))])
    ahead = now + 40 * 86_400
    Writer(engine, witness=ClockWitness(now_ns=lambda: int(ahead * 1e9))).write([message(row(9_999, t=ahead))])
    assert "later than this computer's clock" in doubt(engine, Retention(), ahead)
    note_run(engine, ahead)
    assert not doubt(engine, Retention(), ahead)


def test_the_command_refuses_and_does_what_a_person_insists_on(tmp_path):
    path = str(tmp_path / "a.sqlite")
    engine = open_database(path)
    lots(engine)
    before = count(engine)
    refused = acqd_here("sink", "maintain", "--database", path)
    assert refused.returncode == 2 and "--yes" in refused.stderr and count(engine) == before
    done = acqd_here("sink", "maintain", "--database", path, "--yes", "--json")
    assert done.returncode == 0 and json.loads(done.stdout)["power_deleted"] == before and count(engine) == 0


def test_rows_that_can_be_restored_outlive_the_retention_of_the_quarantine(database):
    engine = open_database(database)
    Writer(engine).write([message(row(0, t=time.time() + 9 * 86_400)), Received("acqd/a/L1/power", b"{")])
    done = maintain(engine, Retention(), time.time() + 100 * 86_400)
    assert done.quarantine_deleted == 1 and count(engine, quarantine) == 1
