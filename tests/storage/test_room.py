"""Rows for as long as the disk has room."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

import pytest

from acqd.storage.clock_witness import ClockWitness
from acqd.storage.database import open_database
from acqd.storage.maintain import Retention, power_cut
from acqd.storage.room import fitted
from acqd.storage.writer import Writer
from acqd.timestamps import filetime
from tests.storage.rows import T0, message, row

DAY = 86_400
A_DAY = 500
"""Rows."""
FIT_DISK = Retention(fits_disk=True)


class Plant:
    """A database that gets rows, and a disk of `total` bytes of which others have `others`."""

    def __init__(self, path, monkeypatch, total=1 << 40):
        self.engine = open_database(str(path / "a.sqlite"))
        self.total, self.others, self.now = total, 0, float(T0)
        monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(total=self.total, free=self.free))

    @property
    def free(self):
        return self.total - self.others - self.pages("page_count")

    def pages(self, name):
        with self.engine.connect() as connection:
            return connection.exec_driver_sql(f"PRAGMA {name}").scalar() * 4096

    @property
    def used(self):
        return self.pages("page_count") - self.pages("freelist_count")

    @property
    def rows(self):
        with self.engine.connect() as connection:
            return connection.exec_driver_sql("SELECT count(*) FROM power_row").scalar()

    def meter(self, days=1):
        begin, self.now = self.now, self.now + days * DAY
        seconds, first = DAY / A_DAY, round((begin - T0) * A_DAY / DAY)
        rows = [row(first + k, t=begin + k * seconds) for k in range(days * A_DAY)]
        witness = ClockWitness(now_ns=lambda: int(self.now * 1e9))
        Writer(self.engine, witness=witness).write([message(one) for one in rows])

    def maintain(self, ahead=0.0):
        """Days of rows that stay; rows past them go."""
        retention = fitted(self.engine, FIT_DISK, self.now + ahead)
        if cut := power_cut(retention, self.now + ahead):
            with self.engine.begin() as connection:
                old = filetime(int(cut) * 10**9)
                connection.exec_driver_sql("DELETE FROM power_row WHERE filetime < ?", (old,))
                connection.exec_driver_sql("DELETE FROM power_stamp WHERE id NOT IN (SELECT id FROM power_row)")
        return retention.power_days


@pytest.fixture
def plant(tmp_path, monkeypatch):
    made = Plant(tmp_path, monkeypatch)
    yield made
    made.engine.dispose()


def test_the_database_stops_growing_where_a_tenth_of_the_disk_is_left_and_the_newest_rows_stay(plant):
    plant.meter(3)
    assert plant.maintain() == 30.0
    plant.total = round(plant.pages("page_count") / 0.9)
    sizes, days = [], []
    for _ in range(6):
        plant.meter()
        days.append(plant.maintain())
        sizes.append(plant.pages("page_count"))
    assert sizes[-1] < 1.25 * sizes[0], "six days of rows came to three"
    assert max(days) < 4.0 and plant.rows > 2 * A_DAY


def test_as_many_rows_go_as_come_where_another_program_fills_the_disk(plant):
    plant.meter(4)
    plant.maintain()
    plant.others = plant.free
    for _ in range(3):
        assert plant.maintain() == 30.0, "nothing has come"
    plant.meter()
    plant.others += plant.free
    plant.maintain()
    assert 3.5 * A_DAY < plant.rows < 4.5 * A_DAY


def test_nothing_goes_where_the_disk_was_full_before_and_where_nobody_has_metered_since(plant):
    plant.meter(3)
    plant.others = plant.free
    assert plant.maintain() == 30.0
    plant.now += 10 * DAY
    assert plant.maintain() == 30.0 and plant.rows == 3 * A_DAY


@pytest.mark.parametrize("ahead", [-400 * DAY, 20 * DAY])
def test_a_clock_that_jumps_lets_no_row_go_that_fits(plant, ahead):
    plant.meter(4)
    plant.maintain()
    plant.total = round(plant.pages("page_count") / 0.9)
    plant.meter()
    plant.maintain(ahead)
    assert plant.rows > 3.5 * A_DAY


def test_pages_that_deleted_rows_have_left_are_room(plant):
    plant.meter(3)
    plant.others = plant.free
    with plant.engine.begin() as connection:
        connection.exec_driver_sql("DELETE FROM power_row WHERE filetime < ?", (filetime(int(T0 + 2 * DAY) * 10**9),))
        connection.exec_driver_sql("DELETE FROM power_stamp")
    assert plant.maintain() == 30.0


def test_days_that_somebody_has_set_and_a_day_of_rows_stay(plant):
    plant.meter(2)
    plant.maintain()
    plant.others = plant.free
    plant.meter()
    assert fitted(plant.engine, Retention(), plant.now).power_days == 30.0
    plant.meter()
    plant.total = 1
    plant.others = 10**12
    assert fitted(plant.engine, FIT_DISK, plant.now).power_days >= 1.0
