"""Roll-ups and retention."""

from __future__ import annotations

import pytest
import sqlalchemy as sa

from acqd.storage.database import open_database
from acqd.storage.maintain import Retention, maintain
from acqd.storage.schema import power_1min, power_15min
from acqd.storage.writer import Received, Writer
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
