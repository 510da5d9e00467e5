"""What somebody has added to a table refuses some rows: these wait, all others are stored."""

from __future__ import annotations

import pytest
import sqlalchemy as sa
from msgspec import structs

from acqd.storage import sifting
from acqd.storage.database import open_database
from acqd.storage.quarantined import Which, entries, restore
from acqd.storage.refusals import REFUSED
from acqd.storage.schema import metadata, power_event, quarantine
from acqd.storage.writer import Writer
from acqd.telemetry.register_row import register_row
from tests.storage.rows import count, message, row
from tests.storage.test_events import event, sent
from tests.storage.test_register_rows import received, summary

BAD = "cell2"
TRIGGER = "CREATE TRIGGER d BEFORE INSERT ON {}"
OF_BAD = f"(SELECT device FROM power_run WHERE id = NEW.id >> 34) = '{BAD}'"
PLPGSQL = (
    "CREATE FUNCTION d() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN IF NEW.device = '" + BAD + "' THEN {} END IF;"
)
EACH = "FOR EACH ROW EXECUTE FUNCTION d()"


def postgres_trigger(does):
    return f"{PLPGSQL.format(does)} RETURN NEW; END $$; {TRIGGER.format('power')} {EACH}"


REFUSALS = {
    "raise": ("sqlite", f"{TRIGGER.format('power_row')} WHEN {OF_BAD} BEGIN SELECT RAISE(ABORT, 'no site'); END"),
    "raise and end": (
        "sqlite",
        f"{TRIGGER.format('power_row')} WHEN {OF_BAD} BEGIN SELECT RAISE(ROLLBACK, 'no site'); END",
    ),
    "drop": ("sqlite", f"{TRIGGER.format('power_row')} WHEN {OF_BAD} BEGIN SELECT RAISE(IGNORE); END"),
    "run": (
        "sqlite",
        f"{TRIGGER.format('power_run')} WHEN NEW.device = '{BAD}' BEGIN SELECT RAISE(ABORT, 'full'); END",
    ),
    "check": ("postgres", f"ALTER TABLE power ADD CONSTRAINT d CHECK (device <> '{BAD}')"),
    "column": ("postgres", "ALTER TABLE power ALTER boot TYPE varchar(6)"),
    "trigger": ("postgres", postgres_trigger("RAISE EXCEPTION 'no site';")),
    "trigger with a code of its own": ("postgres", postgres_trigger("RAISE 'no site' USING ERRCODE = 'U0001';")),
    "trigger drops": ("postgres", postgres_trigger("RETURN NULL;")),
    "part by trigger": ("postgres", postgres_trigger("INSERT INTO gone VALUES (NEW.*); RETURN NULL;")),
    "deferred": (
        "postgres",
        f"{PLPGSQL.format(chr(82) + 'AISE EXCEPTION ' + chr(39) + 'late' + chr(39) + ';')} RETURN NEW; END $$; CREATE "
        f"CONSTRAINT TRIGGER d AFTER INSERT ON power DEFERRABLE INITIALLY DEFERRED {EACH}",
    ),
    "partition": (
        "postgres",
        "ALTER TABLE power RENAME TO old; CREATE TABLE power (LIKE old INCLUDING ALL) PARTITION BY LIST (device);"
        "CREATE TABLE part PARTITION OF power FOR VALUES IN ('cell1', 'cell3')",
    ),
}


def batch(first, devices=("cell1", BAD, "cell3"), windows=4):
    rows = [row(k, device=device) for k in range(first, first + windows) for device in devices]
    return [message(structs.replace(one, boot="boot100") if one.device == BAD else one) for one in rows]


def stored(engine):
    with engine.connect() as connection:
        found = connection.exec_driver_sql("SELECT device, count(*) FROM power GROUP BY 1").all()
    return dict(map(tuple, found))


def receipted(written):
    numbers = {}
    for stream, rows in written.receipts.items():
        numbers[stream.device] = numbers.get(stream.device, 0) + len(rows)
    return {device: number for device, number in numbers.items() if number}


@pytest.mark.parametrize(
    ("database", "change"), REFUSALS.values(), indirect=["database"], ids=[name.replace(" ", "-") for name in REFUSALS]
)
def test_rows_that_a_changed_table_refuses_stop_no_others_and_have_no_receipt(database, change):
    engine = open_database(database)
    writer = Writer(engine)
    writer.write([message(row(0, channel="total"))])
    with engine.begin() as connection:
        connection.exec_driver_sql(change)
    before = stored(engine)
    for first in (0, 4):  # the second time it is known whose rows are refused
        written = writer.write(batch(first))
        assert receipted(written) == {"cell1": 4, "cell3": 4} and written.waiting == 4 and written.rows == 8
    assert {device: number - before.get(device, 0) for device, number in stored(engine).items()} == {
        "cell1": 8, "cell3": 8,
    }  # fmt: skip
    assert f"refuses rows of {BAD}: " in writer.refusals.trouble
    kept = entries(engine, Which())
    assert len(kept) == 8 and all(one.reason.startswith(REFUSED) and one.device == BAD for one in kept)
    assert not receipted(writer.write(batch(0, [BAD]))), "and a batch of nothing else is no end"
    assert receipted(writer.write(batch(8, ["cell3"]))) == {"cell3": 4} and len(entries(engine, Which())) == 8


CHECK = (
    ("sqlite", "CREATE TRIGGER d BEFORE INSERT ON {} BEGIN SELECT RAISE(ABORT, 'no site'); END", "DROP TRIGGER d"),
    ("postgres", "ALTER TABLE {} ADD CONSTRAINT d CHECK (device = 'x') NOT VALID", "ALTER TABLE {} DROP CONSTRAINT d"),
)


@pytest.mark.parametrize(("database", "begin", "end"), CHECK, indirect=["database"], ids=["sqlite", "postgres"])
def test_rows_come_when_the_table_takes_them_again_and_copies_leave_the_quarantine(database, begin, end):
    engine = open_database(database)
    writer = Writer(engine)
    writer.write([message(row(0))])
    table = "power_row" if engine.dialect.name == "sqlite" else "power"
    with engine.begin() as connection:
        connection.exec_driver_sql(begin.format(table))
    for _ in range(2):
        assert not receipted(writer.write([message(row(k)) for k in range(1, 4)]))
    assert restore(engine, Which()).refused == 3 == count(engine, quarantine)
    with engine.begin() as connection:
        connection.exec_driver_sql(end.format(table))
    assert receipted(writer.write([message(row(k)) for k in range(3)])) == {"cell1": 3}
    done = restore(engine, Which())
    assert (done.restored, done.refused, count(engine), count(engine, quarantine)) == (3, 0, 4, 0)


@pytest.mark.parametrize(("database", "begin", "end"), CHECK, indirect=["database"], ids=["sqlite", "postgres"])
@pytest.mark.parametrize("table", ["power_event", "power_register", "quarantine"])
def test_other_tables_that_are_changed_stop_no_rows(database, table, begin, end):
    engine = open_database(database)
    writer = Writer(engine)
    writer.write([message(row(0))])
    if table == "quarantine":
        begin = begin.replace("device = 'x'", "topic = 'x'")
    with engine.begin() as connection:
        connection.exec_driver_sql(begin.format(table))
    other = {
        "power_event": [sent(event(0)), sent(event(1, duration=None))],
        "power_register": [received(register_row(summary(0)))],
        "quarantine": [message(row(0, P=1.0))],  # another row of a key that is stored
    }[table]
    written = writer.write([message(row(1)), *other, message(row(2))])
    receipts = {stream: len(rows) for stream, rows in written.receipts.items() if len(rows)}
    assert list(receipts.values()) == [2] and count(engine) == 3 and writer.refusals.trouble
    with engine.begin() as connection:
        connection.exec_driver_sql(end.format(table))
    receipts = writer.write(other).receipts
    assert sum(map(len, receipts.values())) == len(other) == count(engine, metadata.tables[table])


def test_rows_here_and_there_are_found_and_cost_no_second_transaction(tmp_path, monkeypatch):
    engine = open_database(str(tmp_path / "a.sqlite"))
    writer, commits = Writer(engine), []
    sa.event.listen(engine, "commit", commits.append)
    writer.write([message(row(k)) for k in range(300)])
    assert len(commits) == 2, "one to see which database that is"
    with engine.begin() as connection:
        connection.exec_driver_sql(
            "CREATE TRIGGER d BEFORE INSERT ON power_row WHEN NEW.\"P\" > 9000 BEGIN SELECT RAISE(ABORT, 'P'); END"
        )
    commits.clear()
    odd = {307, 308, 450, 599}
    written = writer.write([message(row(k, P=9001.0 if k in odd else 1.0)) for k in range(300, 600)])
    assert receipted(written) == {"cell1": 296} and written.waiting == 4 and len(commits) == 1
    monkeypatch.setattr(sifting, "_MOST_FAILURES", 100)  # rows that are not tried wait, too
    written = writer.write([message(row(k, P=9001.0 if k % 7 == 0 else 1.0)) for k in range(600, 800)])
    assert 0 < written.rows < 171 and receipted(written)["cell1"] == written.rows == 200 - written.waiting


def test_that_there_are_no_further_copies_is_said_once(tmp_path, caplog):
    engine = open_database(str(tmp_path / "a.sqlite"))
    writer = Writer(engine, malformed_bytes_per_day=2_000)
    with engine.begin() as connection:
        connection.exec_driver_sql(f"{TRIGGER.format('power_row')} BEGIN SELECT RAISE(ABORT, 'no site'); END")
    writer.write([message(row(0))])
    assert "no copy" not in writer.refusals.trouble
    for seq in range(1, 9, 4):
        writer.write([message(row(k)) for k in range(seq, seq + 4)])
    assert 1 < count(engine, quarantine) < 9 and caplog.text.count("of further ones there is no copy") == 1
    assert "those that nobody sends again are lost" in writer.refusals.trouble


def test_copies_that_cannot_leave_the_quarantine_are_not_restored(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    with engine.begin() as connection:
        connection.exec_driver_sql(f"{TRIGGER.format('power_row')} BEGIN SELECT RAISE(ABORT, 'no site'); END")
    Writer(engine).write([message(row(0))])
    with engine.begin() as connection:
        connection.exec_driver_sql("DROP TRIGGER d")
        connection.exec_driver_sql(
            "CREATE TRIGGER d BEFORE DELETE ON quarantine BEGIN SELECT RAISE(ABORT, 'stay'); END"
        )
    done = restore(engine, Which())
    assert (done.restored, done.refused, done.why_refused) == (0, 1, "stay") and count(engine) == 1


def test_a_right_that_was_taken_is_the_tables_and_no_row_is_set_apart(postgres):
    engine = open_database(postgres)
    writer = Writer(engine)
    writer.write(batch(0))
    with engine.begin() as connection:
        connection.exec_driver_sql("ALTER TABLE power RENAME TO hidden")
    for _ in range(2):
        with pytest.raises(sa.exc.DBAPIError, match='"power" does not exist'):
            writer.write(batch(4))
    assert not count(engine, quarantine) and not writer.refusals.trouble


def test_events_that_have_no_table_wait_and_rows_are_stored(database):
    engine = open_database(database)
    writer = Writer(engine)
    with engine.begin() as connection:
        connection.exec_driver_sql("ALTER TABLE power_event RENAME TO hidden")
    for seq in range(2):
        written = writer.write([sent(event(1)), message(row(seq)), sent(event(2))])
        assert receipted(written) == {"cell1": 1} and written.waiting == 2
    with engine.begin() as connection:
        connection.exec_driver_sql("ALTER TABLE hidden RENAME TO power_event")
    assert (
        receipted(writer.write([sent(event(1)), sent(event(2))]))
        == {"cell1": 2}
        == {"cell1": count(engine, power_event)}
    )
