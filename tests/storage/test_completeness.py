"""Which rows of a day are stored, and why others are not: both databases."""

from __future__ import annotations

import json
from datetime import UTC, date, datetime, timedelta

import pytest

from acqd.cli.completeness_table import _share
from acqd.errors import UserError
from acqd.storage.completeness import completeness, day_of
from acqd.storage.database import open_database
from acqd.storage.maintain import Retention, maintain
from acqd.storage.writer import Writer
from acqd.telemetry.spool import Spool, SpooledRow, Stream
from tests.commands import acqd_here, refused
from tests.storage.rows import message, row

DAY = date(2023, 11, 15)
MIDNIGHT = datetime(2023, 11, 15, tzinfo=UTC).timestamp()
STEP = 1.0
"""s between two rows: a coarse meter keeps the tests small."""


def store(engine, rows):
    Writer(engine).write([message(one) for one in rows])


def at(seq, first=MIDNIGHT, **changes):
    return row(seq, t=first + seq * STEP, **changes)


def report(engine, until_s=100.0):
    now = datetime.fromtimestamp(MIDNIGHT + until_s, UTC) + timedelta(seconds=5)
    return completeness(engine, DAY, now)


def gaps(engine, **options):
    [one] = report(engine, **options)
    return [(gap.rows, gap.cause.value) for gap in one.gaps], one


def test_a_complete_day_has_no_gaps(database):
    engine = open_database(database)
    store(engine, [at(k, MIDNIGHT - 10) for k in range(110)] + [at(k, channel="total") for k in range(100)])
    both = report(engine)
    assert [(one.channel, one.expected, one.stored, one.missing, one.gaps) for one in both] == [
        ("L1", 100, 100, 0, []),
        ("total", 100, 100, 0, []),
    ]
    assert both[0].interval_s == STEP


def test_every_cause_is_told_from_the_rows_around_the_gap(database):
    engine = open_database(database)
    first = [at(k, flags=["start"] if not k else []) for k in range(20) if k not in (5, 6)]  # 5 and 6 are lost
    first += [at(k, flags=["gap"] if k == 25 else []) for k in range(25, 30)]  # 20 to 24 were never metered
    second = [at(k, MIDNIGHT + 40, boot="boot2", flags=[] if k else ["start"]) for k in range(20)]
    second += [at(k, MIDNIGHT + 50, boot="boot2", flags=["clock_step"] if k == 20 else []) for k in range(20, 25)]
    third = [at(k, MIDNIGHT + 80, boot="boot3") for k in range(3, 10)]  # 0 to 2 are lost
    store(engine, first + second + third)
    found, one = gaps(engine)
    assert found == [
        (2, "lost"), (5, "not metered"), (10, "daemon not running"), (0, "clock step"),
        (5, "daemon not running"), (3, "lost"), (10, "no rows"),
    ]  # fmt: skip
    assert one.stored == len(first + second + third) and one.missing == 35
    assert one.gaps[0].begin == "2023-11-15T00:00:05.000Z" and one.gaps[0].end == "2023-11-15T00:00:07.000Z"
    assert one.gaps[-1].end == "2023-11-15T00:01:40.000Z"


def test_a_device_is_expected_from_its_first_row_on(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    store(engine, [at(k, MIDNIGHT + 30, flags=[] if k else ["start"]) for k in range(70)])
    found, one = gaps(engine)
    assert found == [] and one.expected == 70


def test_a_day_without_rows_of_a_known_device_is_one_gap(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    store(engine, [at(k, MIDNIGHT - 100) for k in range(50)])
    found, one = gaps(engine)
    assert found == [(2500, "no rows")] and one.stored == 0


def test_a_clock_that_was_set_back_by_hours_is_no_loss(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    store(engine, [at(k) for k in range(50)] + [at(k, MIDNIGHT - 20, boot="boot1.1") for k in range(50, 120)])
    found, _ = gaps(engine)
    assert found == []


def test_past_retention_the_roll_ups_know_how_many_rows_there_were(tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))
    store(engine, [at(k) for k in range(0, 86_400, 60)])
    later = MIDNIGHT + 40 * 86_400
    maintain(engine, Retention(power_days=30), now=later)
    [one] = completeness(engine, DAY, datetime.fromtimestamp(later, UTC))
    assert one.source == "roll-ups" and one.stored == 1_440 and one.gaps == []


def test_days_are_named(tmp_path):
    now = datetime(2026, 3, 1, 0, 30, tzinfo=UTC)
    assert day_of("today", now) == date(2026, 3, 1) and day_of("yesterday", now) == date(2026, 2, 28)
    for text in ("2026-02-30", "1.3.2026", "2026-03-02"):
        with pytest.raises(UserError, match="--day"):
            day_of(text, now)


def test_the_command_reports_lost_rows_with_exit_1(tmp_path):
    path = tmp_path / "a.sqlite"
    store(open_database(str(path)), [at(k) for k in range(86_400 - 20, 86_400) if k != 86_390])
    done = acqd_here("sink", "completeness", "--day", "2023-11-15", "--database", path, "--json")
    assert done.returncode == 1, done.stderr
    [one] = json.loads(done.stdout)
    assert one["stored"] == 19 and one["missing"] == 1 and one["gaps"][0]["cause"] == "lost"
    shown = acqd_here("sink", "completeness", "--day", "2023-11-15", "--database", path)
    assert "95.00 %" in shown.stdout and "lost" in shown.stdout
    assert "no rows of this device" in refused(
        acqd_here("sink", "completeness", "--day", "2023-11-15", "--database", path, "--device", "x")
    )
    assert "no such file" in refused(acqd_here("sink", "completeness", "--database", tmp_path / "b.sqlite"))
    several = ("sink", "completeness", "--from", "2023-11-14", "--to", "2023-11-17", "--database", path)
    assert [one["day"] for one in json.loads(acqd_here(*several, "--json").stdout)] == ["2023-11-15", "2023-11-16"]
    assert "2023-11-16 (UTC)" in acqd_here(*several).stdout
    assert "--day is for one day" in refused(acqd_here(*several, "--day", "today"))
    turned = ("sink", "completeness", "--from", "today", "--to", "2023-11-17")
    assert "expected a day before" in refused(acqd_here(*turned))


def test_rows_that_wait_in_the_spool_are_not_lost(tmp_path, monkeypatch):
    path, state = tmp_path / "a.sqlite", tmp_path / "state"
    last = [k for k in range(86_400 - 20, 86_400) if k not in range(86_385, 86_390)]
    store(open_database(str(path)), [at(k, channel=name) for k in last for name in ("L1", "total")])
    spool = Spool(state / "spool-cell1")
    streams = [Stream("cell1", name, "boot1") for name in ("L1", "total")]
    for k in range(86_385, 86_390):
        spool.append([SpooledRow(stream, k, b"row") for stream in streams if k > 86_385 or stream.channel == "L1"])
    config = tmp_path / "acqd.toml"
    config.write_text(f'state_dir = "{state}"\n')
    monkeypatch.setenv("COLUMNS", "80")
    command = ("sink", "completeness", "--day", "2023-11-15", "--database", path, "--config", config)
    done = acqd_here(*command, "--json")
    found = {one["channel"]: [(gap["rows"], gap["cause"]) for gap in one["gaps"]] for one in json.loads(done.stdout)}
    assert found == {"L1": [(5, "waiting")], "total": [(4, "waiting"), (1, "lost")]}
    assert done.returncode == 1
    spool.append([SpooledRow(streams[1], 86_385, b"row")])  # the daemon still holds the spool
    shown = acqd_here(*command)
    assert shown.returncode == 0, shown.stderr
    [line] = [line for line in shown.stdout.splitlines() if "waiting" in line]  # the gap of both channels, once
    assert " all " in line and "23:59:45.000" in line and "23:59:50.000" in line and " 5 " in line
    spool.close()


def test_rows_after_the_last_one_that_is_stored_wait_too(tmp_path, monkeypatch):
    """The sink is away: nothing of the evening is stored, and the spool has most of it."""
    path, state = tmp_path / "a.sqlite", tmp_path / "state"
    store(open_database(str(path)), [at(k) for k in range(86_360, 86_380)])
    spool = Spool(state / "spool-cell1")
    (config := tmp_path / "acqd.toml").write_text(f'state_dir = "{state}"\n')
    spool.append([SpooledRow(Stream("cell1", "L1", "boot1"), k, b"row") for k in range(86_380, 86_395)])
    command = ("sink", "completeness", "--config", config, "--day", "2023-11-15", "--json", "--database")
    [one] = json.loads(acqd_here(*command, path).stdout)
    assert [(gap["rows"], gap["cause"]) for gap in one["gaps"]] == [(15, "waiting"), (5, "no rows")]
    open_database(str(empty := tmp_path / "empty.sqlite")).dispose()
    done = acqd_here(*command, empty)
    assert done.returncode == 1 and "no row is stored yet, 15 rows wait in" in done.stderr
    spool.close()


def test_a_share_says_100_only_for_a_complete_day():
    assert _share(2_159_999, 2_160_000) == "99.99 %" and _share(7, 7) == "100.00 %" and _share(0, 0) == "-"


def test_a_day_before_the_first_row_is_answered_with_the_first_day_whatever_waits(tmp_path):
    """On the day of an installation, `--day yesterday` has no rows; those of today are stored."""
    path, state = tmp_path / "a.sqlite", tmp_path / "state"
    store(open_database(str(path)), [at(k) for k in range(10)])
    Spool(state / "spool-cell1").append([SpooledRow(Stream("cell1", "L1", "boot1"), k, b"row") for k in range(10, 15)])
    (config := tmp_path / "acqd.toml").write_text(f'state_dir = "{state}"\n')
    done = acqd_here("sink", "completeness", "--config", config, "--day", "2023-11-14", "--database", path)
    assert done.returncode == 1 and "the first day with rows is 2023-11-15" in done.stderr


def test_roll_ups_of_the_first_minute_make_no_gap_before_the_first_row(database):
    engine = open_database(database)
    store(engine, [at(k, MIDNIGHT + 30) for k in range(90)])
    before = report(engine, until_s=120.0)
    maintain(engine, Retention(), MIDNIGHT + 3600)
    assert report(engine, until_s=120.0) == before and before[0].gaps == [] and before[0].stored == 90
