"""Predictions with time and device, and the views for dashboards, in new databases and in old ones."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import sqlalchemy as sa
from alembic import command
from alembic.config import Config

from acqd.sidecar.store import Done, Store
from acqd.storage.database import MIGRATIONS, engine_for, open_database
from acqd.timestamps import filetime

NS = 1_795_396_500_123_456_000
MOMENT = datetime(2026, 11, 23, 1, 15, 0, 123456, UTC)


def moment(value):
    """As PostgreSQL and SQLite give it."""
    return value if isinstance(value, datetime) else datetime.fromisoformat(value)


def done():
    stamps = np.array([filetime(NS), filetime(NS + 40_000_000)])
    return Done("a", "a.log", "m", "ok", {}, stamps, np.array([5.0, 6.0]), np.array([4.0, 7.0]))


def test_a_prediction_has_the_time_and_device_of_its_power(database):
    engine = open_database(database)
    Store(engine, "press-1").commit(done(), {})
    with engine.connect() as connection:
        rows = connection.exec_driver_sql('SELECT * FROM v_prediction ORDER BY "time"').all()
    assert moment(rows[0][0]) == MOMENT and (moment(rows[1][0]) - MOMENT).total_seconds() == pytest.approx(0.04)
    assert [tuple(row[1:]) for row in rows] == [
        ("press-1", "a.log", "m", 5.0, 4.0, 1.0), ("press-1", "a.log", "m", 6.0, 7.0, -1.0)
    ]  # fmt: skip


@pytest.mark.parametrize(("devices", "expected"), [(["only"], "only"), (["one", "two"], None), ([], None)])
def test_an_old_database_gets_times_and_the_device_that_it_can_know(database, devices, expected):
    engine = engine_for(database)
    if engine.dialect.name == "sqlite":
        Path(str(engine.url.database)).touch()
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0003")
        connection.execute(
            sa.text("INSERT INTO prediction (sha256, filetime, \"P\") VALUES ('a', :t, 5.0)"), {"t": filetime(NS)}
        )
        for name in devices:
            connection.execute(
                sa.text(
                    'INSERT INTO power (device, channel, boot, seq, "time", filetime, flags, "schema")'
                    " VALUES (:name, 'L1', 'b', 0, :moment, 1, '[]', 1)"
                ),
                {"name": name, "moment": MOMENT if engine.dialect.name == "postgresql" else MOMENT.isoformat()},
            )
    engine.dispose()
    with open_database(database).connect() as connection:
        row = connection.exec_driver_sql('SELECT device, "time", "P" FROM prediction').one()
    assert (row[0], moment(row[1]), row[2]) == (expected, MOMENT, 5.0)


def test_roll_ups_have_a_time_stamp_in_their_views(database):
    engine = open_database(database)
    with engine.begin() as connection:
        connection.exec_driver_sql(
            'INSERT INTO power_1min (device, channel, "start", "rows", "P", flagged)'
            " VALUES ('a', 'L1', 1795396500, 1500, 7.5, 0)"
        )
    with engine.connect() as connection:
        row = connection.exec_driver_sql('SELECT "time", device, channel, "P", "rows" FROM v_power_1min').one()
        assert connection.exec_driver_sql("SELECT count(*) FROM v_power_15min").scalar() == 0
    assert moment(row[0]) == MOMENT.replace(microsecond=0) and tuple(row[1:]) == ("a", "L1", 7.5, 1500)
