"""Costs of quarter hours for dashboards: the same as those of `acqd energy`, gaps stay gaps (simulated)."""

from __future__ import annotations

from zoneinfo import ZoneInfo

import sqlalchemy as sa

from acqd.energy.quarters import Quarters
from acqd.energy.read import read_account
from acqd.energy.rules import Rules
from acqd.energy.tariff import load_tariff
from acqd.storage.database import open_database, transaction
from acqd.storage.schema import energy_quarter, power_15min
from tests.storage.rows import T0

DAY = 86_400


def rolled_up(engine, starts, W0=0.0):
    rows = [
        {"device": "cell1", "channel": "total", "start": start, "rows": 22_500, "P": 1000.0, "P_min": 900.0,
         "P_max": 1100.0, "W": W0 + 0.25 * k, "flagged": 0}
        for k, start in enumerate(starts)
    ]  # fmt: skip
    with transaction(engine) as connection:
        connection.execute(sa.insert(power_15min), rows)


def test_quarter_hours_have_the_cost_of_the_statement_and_late_ones_come(tmp_path):
    engine = open_database(str(tmp_path / "p.sqlite"))
    (tmp_path / "prices.csv").write_text("time,price\n2023-11-14T22:00Z,100\n2023-11-14T23:00Z,200\n")
    (tmp_path / "t.toml").write_text('name = "spot"\n[series]\nfile = "prices.csv"\nunit = "EUR/MWh"\n')
    tariff = load_tariff(tmp_path / "t.toml")
    begin = T0 // 900 * 900  # 22:15 UTC
    rolled_up(engine, [begin + 900 * k for k in range(9 * 96) if not 8 <= k < 20])
    now = [begin + 9 * DAY + 10.0]
    quarters = Quarters(Rules(tariff, ZoneInfo("UTC")), lambda: now[0])
    assert quarters.update(engine) > 600 and quarters.update(engine) > 100 and quarters.update(engine) == 0
    with engine.connect() as connection:
        stored = {row.start: row for row in connection.execute(sa.select(energy_quarter)).all()}
    assert len(stored) == 9 * 96 - 12 - 1 and begin + 10 * 900 not in stored  # the first has no reading before it
    assert stored[begin + 900].tariff == "spot" and stored[begin + 4 * DAY].EUR is None  # no price any more
    cuts = [begin + 900 * k for k in range(7)]
    expected = read_account(engine, "cell1", cuts, tariff).periods
    quarters = Quarters(Rules(load_tariff(tmp_path / "t.toml"), ZoneInfo("UTC")), lambda: cuts[-1] + 1.0)
    with transaction(engine) as connection:
        connection.execute(sa.delete(energy_quarter))
    assert quarters.update(engine) == 5
    with engine.connect() as connection:
        costs = connection.execute(sa.select(energy_quarter.c.EUR).order_by(energy_quarter.c.start)).scalars().all()
    assert costs == [float(one.cost) for one in expected[1:]] == [0.025, 0.025, 0.05, 0.05, 0.05]
