"""Budgets of days, weeks and months: forecasts with their basis, one alarm a period (simulated)."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from zoneinfo import ZoneInfo

import pytest
import sqlalchemy as sa

from acqd.energy.budget import Budgets, _earlier
from acqd.energy.budget_section import Budget
from acqd.energy.periods import current
from acqd.energy.read import read_accounts
from acqd.energy.rules import Rules
from acqd.energy.tariff import load_tariff
from acqd.errors import UserError
from acqd.integrations.alarms.book import Book
from acqd.integrations.alarms.section import AlarmsSection
from acqd.integrations.alarms.service import Alarms
from acqd.integrations.alarms.watch import ACTIVE, AlarmWatch
from acqd.integrations.regularly import Regularly
from acqd.storage.database import open_database, transaction
from acqd.storage.schema import power_15min
from tests.commands import acqd_here, refused
from tests.integrations.messages import status

BERLIN = ZoneInfo("Europe/Berlin")
HOUR = 3600


def unix(text):
    return round(datetime.fromisoformat(text).replace(tzinfo=BERLIN).timestamp())


NOW = unix("2026-11-26T12:00")  # a Thursday


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """Six weeks of quarter hours until Thursday noon: 1 kW, and 3 kW since this midnight."""
    engine = open_database(str(tmp_path_factory.mktemp("budget") / "p.sqlite"))
    rows, W = [], 0.0
    for start in range(NOW - 42 * 24 * HOUR, NOW, 900):
        P = 3000.0 if start >= unix("2026-11-26") else 1000.0
        W += P / 4000
        rows.append({"device": "cell1", "channel": "total", "start": start, "rows": 22_500, "P": P, "P_min": P,
                     "P_max": P, "W": W, "flagged": 0})  # fmt: skip
    with transaction(engine) as connection:
        connection.execute(sa.insert(power_15min), rows)
    return engine


def standing(engine, now=NOW, tariff=None, **budget):
    (found,) = Budgets([Budget(**budget)], Rules(tariff, BERLIN)).standings(engine, now)
    return found


@pytest.mark.parametrize(
    ("per", "used", "forecast", "basis"),
    [("day", 36, 36 + 12, "the day of Thu 2026-11-19"),
     ("week", 36 + 3 * 24, 108 + 3.5 * 24, "the week of Thu 2026-11-19"),
     ("month", 25 * 24 + 36, 636 + 4.5 * 24, "the last four weeks")],
)  # fmt: skip
def test_the_rest_of_a_period_is_forecast_from_earlier_time(engine, per, used, forecast, basis):
    found = standing(engine, per=per, kWh=forecast - 1)
    assert found.used == pytest.approx(used, abs=0.1) and found.forecast == pytest.approx(forecast, abs=0.1)
    assert found.state == "forecast" and basis in found.text
    assert standing(engine, per=per, kWh=forecast + 5).state == "within"
    assert standing(engine, per=per, kWh=used - 4, device="cell1").state == "exceeded"


def test_a_budget_in_euros_needs_prices_and_uses_them(engine, tmp_path):
    with pytest.raises(UserError, match="needs prices"):
        standing(engine, per="day", EUR=5.0)
    (tmp_path / "t.toml").write_text('price = 0.5\nzone = "Europe/Berlin"\n')
    found = standing(engine, tariff=load_tariff(tmp_path / "t.toml"), per="day", EUR=5.0)
    assert found.state == "exceeded" and found.used == pytest.approx(18, abs=0.1)


def test_a_price_of_minutes_is_met_by_minutes(engine, tmp_path, monkeypatch):
    (tmp_path / "t.toml").write_text(
        'zone = "Europe/Berlin"\n[[time_of_use]]\nprice = 0.1\nhours = "00:00-06:07"\n'
        '[[time_of_use]]\nprice = 0.3\nhours = "06:07-24:00"\n'
    )
    seen = []
    monkeypatch.setattr("acqd.energy.budget.read_accounts", lambda *a: seen.append(a[-1]) or read_accounts(*a))
    for budget in ({"EUR": 500.0}, {"kWh": 500.0}):
        standing(engine, tariff=load_tariff(tmp_path / "t.toml"), per="week", **budget)
    assert seen == [60, 900]


def test_a_week_earlier_is_the_same_time_of_the_clock():
    """The clock changes on Sunday, 2026-10-25."""
    budget, now = Budget(per="day", kWh=1.0), unix("2026-10-29T12:00")
    rest = _earlier(budget, current("day", now, BERLIN), now, BERLIN)
    assert (rest.begin, rest.end) == (unix("2026-10-22T12:00"), unix("2026-10-23"))


def test_what_cannot_be_known_is_said(engine):
    assert (
        "cannot be watched: device 'nobody' has no rows" in standing(engine, per="day", kWh=1.0, device="nobody").text
    )
    away = standing(engine, now=NOW + 400 * 24 * HOUR, per="day", kWh=1.0)  # nobody has chosen this period
    assert away.state == "unknown" and "has no rows from" in away.text and "--from" not in away.text
    early = standing(engine, now=NOW - 41.4 * 24 * HOUR, per="week", kWh=1e4)
    assert early.forecast is None and "too little is known" in early.text


def test_a_budget_is_one_alarm_and_another_when_it_is_exceeded(engine):
    told, standings, now = [], [None], [NOW]
    watch = AlarmWatch(
        Book(0), lambda each: told.append((each.event, each.alarm.key, each.alarm.text)), 30.0,
        lambda: now[0] * 10**9, lambda: standings.pop() if standings else None,
    )  # fmt: skip
    ahead = standing(engine, per="day", kWh=45.0)
    wavering = standing(engine, per="day", kWh=50.0)
    over, tomorrow = standing(engine, per="day", kWh=20.0), standing(engine, now=NOW - 20 * HOUR, per="day", kWh=45.0)
    blind = standing(engine, per="day", kWh=45.0, device="nobody")
    for each in (ahead, ahead, wavering, over, ahead, over):
        standings.append([each])
        messages = list(watch.tick())
        watch.take(*status("all"))  # a daemon of that name that is well ends no budget's alarm
    assert [event for event, *_ in told] == ["raised", "raised"] and told[0][1] == "all/budget-day-kWh"
    assert "if the rest is like" in told[0][2] and "is exceeded" in told[1][2]
    assert all(message.topic == ACTIVE for message in messages)
    for _ in range(2):
        standings.append([tomorrow])
        list(watch.tick())
    assert told[2][0] == "resolved" and len(told) == 3
    for _ in range(3):  # nobody's rows: an alarm after an hour, once
        standings.append([blind])
        list(watch.tick())
        now[0] += 2000
    assert [event for event, *_ in told[3:]] == ["raised"] and "cannot be watched" in told[3][2]


def test_budgets_of_the_configuration(engine, tmp_path, monkeypatch):
    monkeypatch.setattr("acqd.cli.alarms.time.time", lambda: NOW)
    (tmp_path / "t.toml").write_text('price = 0.5\nzone = "Europe/Berlin"\n')
    text = (
        f"[sink]\ndatabase = '{engine.url.database}'\n[energy]\ntariff = 't.toml'\n[[alarms.budgets]]\nper = 'month'\n"
    )
    (tmp_path / "acqd.toml").write_text(f"{text}EUR = 300.0\n")
    done = acqd_here("alarms", "budgets", "--json", "--config", tmp_path / "acqd.toml")
    (found,) = json.loads(done.stdout)
    assert found["state"] == "exceeded" and found["used"] == pytest.approx(318, abs=0.1)
    (tmp_path / "acqd.toml").write_text(f"{text}EUR = 300.0\nkWh = 3.0\n")
    assert "either kWh or EUR" in refused(acqd_here("alarms", "budgets", "--config", tmp_path / "acqd.toml"))
    with pytest.raises(ValueError, match="two of all devices in kWh per day"):
        AlarmsSection(budgets=[Budget(per="day", kWh=1.0), Budget(per="day", kWh=2.0)])


def ends(folder, begin, end):
    """A tariff with a price of 0.5 EUR between two Unix times."""
    times = (datetime.fromtimestamp(at, UTC).isoformat() for at in range(begin, end, HOUR))
    (folder / "prices.csv").write_text("time,price\n" + "".join(f"{at},0.5\n" for at in times))
    (folder / "t.toml").write_text('zone = "Europe/Berlin"\n[series]\nfile = "prices.csv"\nunit = "EUR/kWh"\n')
    return load_tariff(folder / "t.toml")


def test_a_budget_needs_the_prices_of_what_is_used_and_no_others(engine, tmp_path):
    today = unix("2026-11-26")
    tariff = ends(tmp_path, today, today + 24 * HOUR)
    found = standing(engine, tariff=tariff, per="day", EUR=100.0)
    assert found.used == pytest.approx(18, abs=0.1) and found.forecast == pytest.approx(36, abs=0.2)
    assert "at the rate of this day so far" in found.text, "no forecast without prices"
    tariff = ends(tmp_path, today - 48 * HOUR, today)
    assert "cannot be watched" in standing(engine, tariff=tariff, per="day", EUR=100.0).text
    assert standing(engine, tariff=tariff, per="day", kWh=30.0).state == "exceeded"


def test_budgets_that_a_database_does_not_answer_are_unknown_and_an_error_ends_no_thread(tmp_path, monkeypatch):
    budgets = Budgets([Budget(per="day", kWh=5.0)], Rules(None, BERLIN))
    reader = Regularly(
        str(tmp_path / "none.sqlite"), lambda engine: budgets.standings(engine, NOW), 1.0,
        lambda why: budgets.unknown(why, NOW),
    )  # fmt: skip
    reader.once()
    (found,) = reader.newest()
    assert found.state == "unknown" and "cannot be watched: " in found.text and reader.trouble in found.text
    open_database(str(tmp_path / "none.sqlite"))
    monkeypatch.setattr(budgets, "standings", lambda *_: [][0])
    reader.once()
    assert "IndexError" in reader.newest()[0].text and reader.failures == 2


def test_the_alarm_of_the_last_budget_ends_when_it_is_removed(tmp_path, engine):
    section = AlarmsSection(state=tmp_path / "alarms.json")
    before = Alarms(section)
    list(before.watch._budgets.take([standing(engine, per="day", kWh=1.0)], NOW))
    for _ in before._book.raise_("cell1/offline", "cell1: offline", NOW):
        before.save()
    after = Alarms(section)
    assert set(after._book.active) == {"all/budget-day-kWh", "cell1/offline"}
    after.watch.tick()
    assert set(after._book.active) == {"cell1/offline"}
