"""Rows for as long as the disk has room."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

import pytest

from acqd.storage.clock_witness import ClockWitness
from acqd.storage.database import open_database
from acqd.storage.maintain import Retention
from acqd.storage.room import fitted
from acqd.storage.writer import Writer
from tests.storage.rows import T0, message, row

DAY = 86_400


def of_ten_days(path):
    engine = open_database(str(path))
    rows = [row(k, t=T0 + k * DAY / 100) for k in range(1_001)]
    Writer(engine, witness=ClockWitness(now_ns=lambda: int((T0 + 10 * DAY) * 1e9))).write(
        [message(one) for one in rows]
    )
    return engine


@pytest.mark.parametrize(
    ("free", "share", "days"),
    [(5.0, 0.0, 30.0), (1.0, 0.0, 20.0), (0.0, 0.0, 10.0), (0.0, 2.0, 10.0), (5.0, 4.0, 20.0)],
)  # fmt: skip
def test_rows_stay_for_as_long_as_there_is_room_and_the_database_never_shrinks_for_others(
    free, share, days, tmp_path, monkeypatch
):
    """`free` bytes of the disk and the tenth of it that stays free, in sizes of the database."""
    engine = of_ten_days(tmp_path / "a.sqlite")
    with engine.connect() as connection:
        size, pages = (connection.exec_driver_sql(f"PRAGMA page_{name}").scalar() for name in ("size", "count"))
    disk = SimpleNamespace(free=free * size * pages, total=10 * share * size * pages)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: disk)
    assert fitted(engine, Retention(fits_disk=True)).power_days == pytest.approx(days, rel=1e-3)
    assert fitted(engine, Retention()).power_days == 30.0


def test_pages_that_deleted_rows_have_left_are_room(tmp_path, monkeypatch):
    engine = of_ten_days(tmp_path / "a.sqlite")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=0, total=1))
    with engine.begin() as connection:
        connection.exec_driver_sql("DELETE FROM power_row WHERE rowid % 4 <> 0")
        connection.exec_driver_sql("DELETE FROM power_stamp")
    assert fitted(engine, Retention(fits_disk=True)).power_days >= 10.0


def test_less_than_a_day_of_rows_says_nothing(tmp_path, monkeypatch):
    engine = open_database(str(tmp_path / "a.sqlite"))
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=0, total=1))
    assert fitted(engine, Retention(fits_disk=True)).power_days == 30.0
    Writer(engine).write([message(row())])
    assert fitted(engine, Retention(fits_disk=True)).power_days == 30.0
