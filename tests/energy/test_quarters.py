"""Costs of quarter hours for dashboards: the same as those of `acqd energy`, gaps stay gaps (simulated)."""

from __future__ import annotations

from datetime import UTC, datetime
from fractions import Fraction

import sqlalchemy as sa

from acqd.energy.quarters import Quarters
from acqd.energy.read import read_account
from acqd.energy.tariff import Tariff, load_tariff
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
    quarters = Quarters(lambda: tariff, lambda: now[0])
    assert quarters.update(engine) > 600 and quarters.update(engine) > 100 and quarters.update(engine) == 0
    with engine.connect() as connection:
        stored = {row.start: row for row in connection.execute(sa.select(energy_quarter)).all()}
    assert len(stored) == 9 * 96 - 12 - 1 and begin + 10 * 900 not in stored  # the first has no reading before it
    assert stored[begin + 900].tariff == "spot" and stored[begin + 4 * DAY].EUR is None  # no price any more
    cuts = [begin + 900 * k for k in range(7)]
    expected = read_account(engine, "cell1", cuts, tariff).periods
    quarters = Quarters(lambda: tariff, lambda: cuts[-1] + 1.0)
    with transaction(engine) as connection:
        connection.execute(sa.delete(energy_quarter))
    assert quarters.update(engine) == 5
    with engine.connect() as connection:
        costs = connection.execute(sa.select(energy_quarter.c.EUR).order_by(energy_quarter.c.start)).scalars().all()
    assert costs == [float(one.cost) for one in expected[1:]] == [0.025, 0.025, 0.05, 0.05, 0.05]


def lines(engine):
    with engine.connect() as connection:
        return {row.start: row for row in connection.execute(sa.select(energy_quarter)).all()}


def spot(folder, hours, price=100):
    """A series of `hours` prices from 22:00 UTC; as a function that reads it again."""
    first = T0 // 3600 * 3600
    text = "".join(f"{datetime.fromtimestamp(first + 3600 * k, UTC).isoformat()},{price}\n" for k in range(hours))
    (folder / "prices.csv").write_text("time,price\n" + text)
    (folder / "t.toml").write_text('name = "spot"\n[series]\nfile = "prices.csv"\nunit = "EUR/MWh"\n')
    return lambda: load_tariff(folder / "t.toml")


def test_costs_stay_when_a_series_ends_and_come_when_it_is_extended(tmp_path):
    engine = open_database(str(tmp_path / "p.sqlite"))
    begin = T0 // 900 * 900  # 22:15 UTC; the prices end at 1:00
    rolled_up(engine, [begin + 900 * k for k in range(60)])
    now = [begin + 11 * 900 + 1.0]
    quarters = Quarters(spot(tmp_path, 3), lambda: now[0])
    quarters.update(engine)
    assert [line.EUR for line in lines(engine).values()] == [0.025] * 10
    for k in (12, 13, 60):
        now[0] = begin + 900 * k + 1.0
        quarters.update(engine)
    assert [line.EUR for line in lines(engine).values()] == [0.025] * 10 + [None] * 49
    spot(tmp_path, 30)
    rolled_up(engine, [begin + 60 * 900], 15.0)
    now[0] += 900
    quarters.update(engine)
    assert [line.EUR for line in lines(engine).values()] == [0.025] * 60
    (tmp_path / "prices.csv").write_text("time,price\n2023-11-15T10:00Z,100\n")  # the old prices have been cut off
    Quarters(lambda: load_tariff(tmp_path / "t.toml"), lambda: now[0]).update(engine)
    assert {line.EUR for line in lines(engine).values()} == {0.025}, "what is stored stays"


def test_rows_of_a_backlog_and_deleted_lines_get_a_line_and_others_keep_theirs(tmp_path):
    engine = open_database(str(tmp_path / "p.sqlite"))
    begin = T0 // 900 * 900
    late = range(96, 4 * 96)
    rolled_up(engine, [begin + 900 * k for k in range(6 * 96) if k not in late])
    now = [begin + 6 * DAY + 1.0]
    price = [Fraction(1, 10)]
    quarters = Quarters(lambda: Tariff("t", price=price[0]), lambda: now[0])
    while quarters.update(engine):
        pass
    rolled_up(engine, [begin + 900 * k for k in late], 0.25 * 96)
    with transaction(engine) as connection:
        connection.execute(sa.delete(energy_quarter).where(energy_quarter.c.start == begin + 900 * 50))
    price[0], now[0] = Fraction(2, 10), now[0] + DAY
    while quarters.update(engine):
        pass
    found = lines(engine)
    assert len(found) == 6 * 96 - 1 and found[begin + 900].EUR == 0.025
    assert {found[begin + 900 * k].EUR for k in (50, 97, 200)} == {0.05}


def test_a_step_beyond_every_register_is_no_energy_and_stops_nothing(tmp_path):
    engine = open_database(str(tmp_path / "p.sqlite"))
    begin = T0 // 900 * 900
    rolled_up(engine, [begin + 900 * k for k in range(4)])
    rolled_up(engine, [begin + 900 * k for k in range(4, 8)], 2e7)
    account = read_account(engine, "cell1", [begin, begin + 7200], None)
    assert account.total.kWh == 1.5 and account.jumps == [begin + 5 * 900]
    assert account.jumps_nWh == 2 * 10**19 - 75 * 10**10
    assert account.register_nWh == account.total.nWh + account.between_nWh + account.jumps_nWh
