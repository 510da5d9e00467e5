"""Rows from the future: which clock is wrong, and what becomes of the rows."""

from __future__ import annotations

import itertools
import os
import time

import pytest
import sqlalchemy as sa

from acqd.errors import UserError
from acqd.storage.clock_witness import FLAG, ClockWitness
from acqd.storage.database import open_database
from acqd.storage.quarantined import Restored, Which, drop, entries, restore
from acqd.storage.received import Received
from acqd.storage.schema import power, quarantine
from acqd.storage.writer import Writer
from acqd.telemetry.register_row import register_row
from acqd.uptime import Moment
from tests.commands import acqd_here
from tests.storage.rows import T0, count, message, row
from tests.storage.test_events import event
from tests.storage.test_events import sent as event_message
from tests.storage.test_register_rows import received, summary

DAY = 86_400
START = os.urandom(16)


class Clock:
    """A wall clock that anybody can set, and a monotonic one that nobody can."""

    def __init__(self, wall_s=T0, start=START):
        self.wall_s, self.start, self.up_s = wall_s, start, 1_000.0

    def passes(self, seconds):
        self.wall_s += seconds
        self.up_s += seconds

    def witness(self, synchronised=None):
        return ClockWitness(
            lambda: synchronised,
            lambda: round(self.wall_s * 1e9),
            lambda: Moment(self.start, round(self.up_s * 1e9)),
        )


def flags(engine):
    with engine.connect() as connection:
        return [one.flags for one in connection.execute(sa.select(power).order_by(power.c.filetime))]


def test_a_sink_whose_clock_starts_days_behind_stores_the_rows_with_a_flag_and_says_so(database):
    engine, clock = open_database(database), Clock()
    Writer(engine, witness=clock.witness()).write([message(row(0, t=T0))])
    back = Clock(T0 - 2 * DAY, b"another start...")
    writer = Writer(engine, witness=back.witness())
    sent = [message(row(k, t=T0 + 540 + k)) for k in range(1, 200)]
    written = writer.write(sent)
    assert (written.rows, written.quarantined) == (199, 0) and "set back" in writer.witness.trouble
    assert flags(engine) == [[], *[[FLAG]] * 199]
    back.wall_s = T0 + back.up_s
    again = writer.write([*sent, message(row(300, t=T0 + 600))])
    assert (again.rows, again.conflicts) == (200, 0), "sent again without the flag, the rows are the same"
    assert count(engine) == 201 and not writer.witness.trouble and flags(engine)[-1] == [FLAG]


def test_a_clock_that_is_set_back_while_the_sink_runs_changes_nothing(database):
    engine, clock = open_database(database), Clock()
    writer = Writer(engine, witness=clock.witness())
    writer.write([message(row(0, t=T0))])
    clock.passes(100)
    clock.wall_s -= 400 * DAY
    assert writer.write([message(row(1, t=T0 + 100))]).rows == 1 and "set back" in writer.witness.trouble
    clock.passes(3 * DAY)
    assert writer.write([message(row(2, t=T0 + 100 + 3 * DAY))]).rows == 1, "time goes on without the clock"


def test_a_clock_that_was_ahead_is_forgotten_once_somebody_disciplines_it(database):
    engine, clock, disciplined = open_database(database), Clock(), [False]
    witness = ClockWitness(
        lambda: disciplined[0], lambda: round(clock.wall_s * 1e9), lambda: Moment(START, round(clock.up_s * 1e9))
    )
    writer = Writer(engine, witness=witness)
    clock.wall_s += 400 * DAY
    writer.write([message(row(0, t=T0))])
    clock.wall_s = T0 + 10
    writer.write([message(row(1, t=T0 + 10))])
    assert "set back" in witness.trouble, "nobody disciplines the clock: it may be the one that is wrong"
    disciplined[0] = True
    assert writer.write([message(row(2, t=T0 + 11))]).rows == 1 and not witness.trouble
    assert writer.write([message(row(3, t=T0 + 40 * DAY))]).impossible == 1
    again = Writer(engine, witness=Clock(T0 + 20).witness())
    assert again.write([message(row(4, t=T0 + 12))]).rows == 1 and not again.witness.trouble, "after a restart, too"


def test_one_device_from_the_future_waits_in_quarantine_and_is_restored_exactly_once(database):
    engine, clock = open_database(database), Clock()
    writer = Writer(engine, 1_000.0, witness=clock.witness())
    odd = [row(k, t=T0 + 2 * DAY + k, flags=["gap"]) for k in range(700)]
    written = writer.write([message(row(0, t=T0, device="cell2")), *map(message, odd)])
    assert (written.rows, written.quarantined, written.impossible) == (1, 700, 700)
    assert sum(len(ranges) for ranges in written.receipts.values()) == 701
    assert count(engine, quarantine) == 700, "no allowance counts rows that can be restored"
    which = Which(device="cell1", reason="impossible time")
    assert [entry.device for entry in entries(engine, which, 3)] == ["cell1"] * 3
    assert restore(engine, which) == Restored(700) and restore(engine, which) == Restored()
    with engine.connect() as connection:
        stored = connection.execute(
            sa.select(power.c.filetime, power.c.flags).where(power.c.device == "cell1").order_by("seq")
        ).all()
    assert [tuple(one) for one in stored] == [(one.filetime, ["gap"]) for one in odd]
    assert writer.write([message(row(0, t=T0 + 3 * DAY))]).impossible == 1, "restored rows are no witness"


def test_a_restored_row_whose_key_is_taken_stays_in_quarantine(database):
    engine, clock = open_database(database), Clock()
    writer = Writer(engine, witness=clock.witness())
    writer.write([message(row(1)), message(row(1, t=T0 + 2 * DAY)), Received("acqd/cell1/L1/power", b"{")])
    assert restore(engine, Which()) == Restored(0, 1, 1) and count(engine, quarantine) == 2
    assert drop(engine, Which()) == 2 and count(engine, quarantine) == 0 and count(engine) == 1


@pytest.mark.parametrize("kind", ["event", "registers"])
def test_events_and_registers_are_restored_too(database, kind):
    engine, clock = open_database(database), Clock()
    late = row(0, t=T0 + 2 * DAY)
    if kind == "event":
        sent = event_message(event(filetime=late.filetime, time=late.time))
    else:
        sent = received(register_row(summary(2 * DAY)))
    written = Writer(engine, witness=clock.witness()).write([sent])
    assert written.impossible == 1
    assert restore(engine, Which()) == Restored(1)


def test_devices_that_agree_are_believed_more_than_this_clock(database):
    engine, clock = open_database(database), Clock()
    writer = Writer(engine, witness=clock.witness())
    sent = [
        Received(f"acqd/cell{k}/L1/power", row(0, device=f"cell{k}", t=T0 + 5 * DAY + k).to_json()) for k in range(3)
    ]
    assert writer.write(sent[:2]).impossible == 2, "two might be wrong together"
    assert writer.write(sent).rows == 3 and "behind" in writer.witness.trouble


@pytest.mark.parametrize(
    ("synchronised", "row_flags", "stored"),
    [(False, [], 1), (False, ["unsynchronised"], 0), (True, [], 0), (None, [], 0)],
)
def test_a_disciplined_clock_is_believed_more_than_one_that_nobody_disciplines(
    tmp_path, synchronised, row_flags, stored
):
    engine = open_database(str(tmp_path / "a.sqlite"))
    writer = Writer(engine, witness=Clock().witness(synchronised))
    assert writer.write([message(row(0, t=T0 + 3 * DAY, flags=row_flags))]).rows == stored


def test_malformed_messages_beyond_their_share_have_no_receipt(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    writer = Writer(engine, malformed_bytes_per_day=5_000)
    written = writer.write([message(row(k, P=1e30)) for k in range(100)])
    kept = count(engine, quarantine)
    assert 0 < kept < 100 and sum(len(ranges) for ranges in written.receipts.values()) == kept


def test_the_command_lists_shows_restores_and_drops(tmp_path):
    path = str(tmp_path / "a%b?c.sqlite")
    engine = open_database(path)
    Writer(engine).write([message(row(k, t=time.time() + 3 * DAY)) for k in range(3)])
    numbers = itertools.count(1)
    listed = acqd_here("sink", "quarantine", "list", "--database", path, "--json")
    assert listed.returncode == 0 and '"total":3' in listed.stdout and "impossible time" in listed.stdout
    shown = acqd_here("sink", "quarantine", "show", str(next(numbers)), "--database", path)
    assert shown.returncode == 0 and '"device": "cell1"' in shown.stdout
    assert acqd_here("sink", "quarantine", "show", "99", "--database", path).returncode == 2
    assert acqd_here("sink", "quarantine", "restore", "--database", path).returncode == 2
    done = acqd_here("sink", "quarantine", "restore", "1", "2", "--database", path)
    assert done.returncode == 0 and "2 rows restored" in done.stdout and count(engine) == 2
    assert acqd_here("sink", "quarantine", "drop", "3", "--database", path).returncode == 2
    assert count(engine, quarantine) == 1
    assert acqd_here("sink", "quarantine", "drop", "3", "--yes", "--database", path).returncode == 0
    assert count(engine, quarantine) == 0


def test_a_path_is_taken_as_it_is_and_a_url_with_a_question_mark_is_refused(tmp_path):
    folder = tmp_path / "100 % of it"
    folder.mkdir()
    open_database(str(folder / "a?b.sqlite"))
    assert {path.name for path in folder.glob("*sqlite")} == {"a?b.sqlite"}
    with pytest.raises(UserError, match=r"\?"):
        open_database(f"sqlite:///{folder}/a?c.sqlite")
    assert not (folder / "a").exists()
