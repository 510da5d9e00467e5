"""Ranges of the calendar, comparisons, meters without samples, export, and registers after a power cut (simulated)."""

import json
from datetime import datetime
from zoneinfo import ZoneInfo

import pytest
import sqlalchemy as sa

from acqd.energy import periods
from acqd.energy.account import sum_of
from acqd.energy.read import read_accounts
from acqd.energy.tariff import load_tariff
from acqd.storage.database import open_database, transaction
from acqd.storage.schema import power_1min, power_15min
from acqd.storage.writer import Writer
from tests.commands import acqd_here
from tests.storage.rows import T0, message, row

BERLIN = ZoneInfo("Europe/Berlin")


def unix(text):
    return round(datetime.fromisoformat(text).replace(tzinfo=BERLIN).timestamp())


def shown(begin, end, zone=BERLIN):
    return [datetime.fromtimestamp(at, zone).isoformat()[:16] for at in (begin, end)]


@pytest.mark.parametrize(
    ("name", "last", "before_last", "this", "before_this"),
    [
        ("day", ("03-29T00:00", "03-30T00:00"), ("03-28T00:00", "03-29T00:00"), "03-30T00:00", "03-29T00:00"),
        ("week", ("03-23T00:00", "03-30T00:00"), ("03-16T00:00", "03-23T00:00"), "03-30T00:00", "03-23T00:00"),
        ("month", ("02-01T00:00", "03-01T00:00"), ("01-01T00:00", "02-01T00:00"), "03-01T00:00", "02-01T00:00"),
    ],
)
def test_last_and_this_follow_the_calendar(name, last, before_last, this, before_this):
    now = unix("2026-03-30T10:20")  # the Monday after the hour that is left out
    chosen, earlier = periods.last_range(name, now, BERLIN)
    assert [each[5:] for each in shown(chosen.begin, chosen.end)] == list(last)
    assert [each[5:] for each in shown(earlier.begin, earlier.end)] == list(before_last)
    chosen, earlier = periods.this_range(name, now, BERLIN)
    assert [each[5:] for each in shown(chosen.begin, chosen.end)] == [this, "03-30T10:15"]
    assert shown(earlier.begin, earlier.end)[0][5:] == before_this
    assert earlier.end <= chosen.begin
    if name != "month":  # as far into the period; February has no 30th
        assert shown(earlier.begin, earlier.end)[1][10:] == "T10:15"


@pytest.fixture(scope="module")
def quarters(tmp_path_factory):
    """Quarter hours from 27 September to 29 October: 3 kW up to the end of September, then 5 kW."""
    database = str(tmp_path_factory.mktemp("quarters") / "acqd.sqlite")
    begin, change, end = unix("2026-09-27"), unix("2026-10-01"), unix("2026-10-29T12:00")
    rows, W = [], 0.0
    for start in range(begin, end, 900):
        P = 3000.0 if start < change else 5000.0
        W += P / 4000
        rows.append({"device": "cell1", "channel": "total", "start": start, "rows": 22_500, "P": P, "P_min": P,
                     "P_max": P, "W": W, "flagged": 0})  # fmt: skip
    engine = open_database(database)
    with transaction(engine) as connection:
        connection.execute(sa.insert(power_15min), rows)
    engine.dispose()
    return database


def ask(database, *words, **more):
    done = acqd_here("energy", "--database", database, "--zone", "Europe/Berlin", "--json", *words, **more)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_day_of_25_hours_is_compared_with_the_day_before(quarters, monkeypatch):
    monkeypatch.setattr("acqd.cli.energy.period.time.time", lambda: unix("2026-10-26T08:00"))
    said = ask(quarters, "--last", "day")
    assert said["total"]["kWh"] == pytest.approx(125.0) and said["before"]["before"] == pytest.approx(120.0)
    assert said["before"]["quantity"] == "kWh" and said["before"]["change"] == pytest.approx(5 / 120)
    said = ask(quarters, "--this", "day")  # 8 hours against the 8 hours up to eight o'clock, of which there were 9
    assert said["total"]["kWh"] == pytest.approx(40.0) and said["before"]["before"] == pytest.approx(45.0)


def test_a_capacity_price_per_month_is_of_the_maximum_of_every_month(quarters, tmp_path):
    tariff = tmp_path / "tariff.toml"
    for per, expected in (("month", 10 * (3 + 5)), ("year", 10 * 5)):
        tariff.write_text(f'price = 0.3\n[capacity]\nprice = 10.0\nper = "{per}"\n')
        said = ask(quarters, "--from", "2026-09-28", "--to", "2026-10-20", "--by", "month", "--tariff", tariff)
        assert said["capacity_EUR"] == pytest.approx(expected) and said["capacity_per"] == per


def stored(folder, rows):
    database = str(folder / "acqd.sqlite")
    engine = open_database(database)
    Writer(engine).write([message(each) for each in rows])
    engine.dispose()
    return database


def utc(at):
    return datetime.fromtimestamp(at, ZoneInfo("UTC")).isoformat()


def exact(device):
    parts = sum(period["nWh"] or 0 for period in device["periods"])
    return parts + device["over_gaps_nWh"] + device["register_set_nWh"] == device["register_nWh"]


def test_an_rms_meter_with_a_coarse_register_has_no_gaps_and_no_steps(tmp_path):
    count = 240  # two hours, a row every 30 s, a register of 0.1 kWh
    rows = [row(k, t=T0 + 30 * k, P=1000.0, W=int(10 * 30 * (k + 1) / 3600) / 10) for k in range(count)]
    said = ask(stored(tmp_path, rows), "--from", utc(T0), "--to", utc(T0 + 7200), "--by", "hour")
    device = said["devices"][0]
    assert exact(device) and device["register_set_nWh"] == 0 and device["total"]["missing_s"] == 0
    assert device["total"]["kWh"] == pytest.approx(2.0, abs=0.11)
    assert device["total"]["mean_W"] == pytest.approx(1000.0)


def test_export_is_paid_at_feed_in_and_emissions_follow_their_series(tmp_path):
    rows, W = [], 1.0
    for k in range(1800):  # an hour, a row every 2 s: half an hour of import, half an hour of export
        P = 3000.0 if k < 900 else -2000.0
        W += P * 2 / 3.6e6
        rows.append(row(k, t=T0 + 2 * k, P=P, W=W))
    hours = [f"{utc(T0 // 3600 * 3600 + 900 * k)},{200 if k < 3 else 400}" for k in range(-4, 12)]
    (tmp_path / "co2.csv").write_text("\n".join(["time,factor", *hours, ""]))
    (tmp_path / "tariff.toml").write_text(
        'price = 0.3\nfeed_in = 0.08\n[co2_series]\nfile = "co2.csv"\nunit = "g/kWh"\n'
    )
    said = ask(stored(tmp_path, rows), "--from", utc(T0), "--to", utc(T0 + 3600), "--tariff", tmp_path / "tariff.toml")
    total = said["total"]
    assert total["kWh"] == pytest.approx(1.5 - 1.0, abs=0.003)
    assert total["EUR"] == pytest.approx(0.3 * 1.5 - 0.08 * 1.0, abs=0.001)
    quarters = [(T0 + 900 * k) // 900 * 900 - T0 // 3600 * 3600 for k in range(2)]
    expected = sum(0.75 * (0.2 if at < 2700 else 0.4) for at in quarters)
    assert total["CO2_kg"] == pytest.approx(expected, rel=0.01)  # of import only


def minutes(folder, powers, lacking=()):
    """Roll-ups of minutes and quarter hours, from 00:00 UTC."""
    engine = open_database(str(folder / "m.sqlite"))
    for table, step in ((power_1min, 1), (power_15min, 15)):
        rows, W = [], 1.0
        for k in range(0, len(powers), step):
            P = powers[k : k + step]
            W += sum(P) / 60_000
            if not set(range(k, k + step)) & set(lacking):
                rows.append({"device": "cell1", "channel": "total", "start": MIDNIGHT + 60 * k, "rows": 1500 * step,
                             "P": sum(P) / step, "P_min": min(P), "P_max": max(P), "W": W, "flagged": 0})  # fmt: skip
        with transaction(engine) as connection:
            connection.execute(sa.insert(table), rows)
    return engine


MIDNIGHT = 1_780_272_000  # 2026-06-01


def test_a_quarter_hour_that_exports_on_balance_costs_the_same_in_minutes(tmp_path):
    engine = minutes(tmp_path, [6000.0 if k % 15 < 5 else -6000.0 for k in range(120)])
    (tmp_path / "t.toml").write_text("price = 0.3\nfeed_in = 0.08\nco2 = 0.4\n")
    tariff, cuts = load_tariff(tmp_path / "t.toml"), [MIDNIGHT + 900 * k for k in range(1, 9)]
    fine, coarse = (read_accounts(engine, "cell1", [cuts], tariff, seconds=step)[0].periods for step in (60, 900))
    assert [float(one.cost) for one in fine] == pytest.approx([-0.5 * 0.08] * 7)
    assert [float(one.cost) for one in coarse] == pytest.approx([-0.5 * 0.08] * 7)
    assert {float(one.co2_kg) for one in (*fine, *coarse)} == {0.0}


def test_co2_of_devices_of_which_one_has_no_factor_is_a_lower_bound(tmp_path):
    engine = minutes(tmp_path, [6000.0] * 30)
    (tmp_path / "t.toml").write_text("price = 0.3\nco2 = 0.4\n")
    spans = [[MIDNIGHT, MIDNIGHT + 1800]]
    known, without = (
        read_accounts(engine, "cell1", spans, tariff, seconds=60)[0].total
        for tariff in (load_tariff(tmp_path / "t.toml"), None)
    )
    both = sum_of([known, without])
    assert both.no_co2_nWh == both.unpriced_nWh == without.nWh and both.co2_kg == known.co2_kg
    assert sum_of([without, without]).no_co2_nWh == 0


def test_energy_over_a_change_of_price_or_factor_in_a_gap_has_neither(tmp_path):
    engine = minutes(tmp_path, [6000.0] * 60, lacking=range(20, 40))
    (tmp_path / "co2.csv").write_text("time,g\n2026-06-01T00:00Z,100\n2026-06-01T00:30Z,900\n")
    (tmp_path / "t.toml").write_text(
        'zone = "UTC"\nco2_series = {file = "co2.csv", unit = "g/kWh"}\n'
        '[[time_of_use]]\nprice = 0.2\nhours = "00:00-00:25,00:28-24:00"\n'
        '[[time_of_use]]\nprice = 9.0\nhours = "00:25-00:28"\n'
    )
    tariff = load_tariff(tmp_path / "t.toml")
    (hour,) = read_accounts(engine, "cell1", [[MIDNIGHT, MIDNIGHT + 3600]], tariff, seconds=60)[0].periods
    assert hour.kWh == pytest.approx(5.9) and hour.missing_s == 1200  # the first minute has no reading before
    assert hour.unpriced_nWh == hour.no_co2_nWh == pytest.approx(2.1e12)  # the gap, and the minute after it
    assert float(hour.cost) == pytest.approx(3.8 * 0.2)
    assert float(hour.co2_kg) == pytest.approx(1.9 * 0.1 + 1.9 * 0.9)


def test_a_register_that_is_a_second_back_after_a_power_cut_is_no_step(tmp_path):
    rows = [row(k, t=T0 + 2 * k, P=1800.0, W=5.0 + 1800.0 * 2 * k / 3.6e6) for k in range(150)]
    back = rows[-1].W - 1800.0 * 0.9 / 3.6e6  # the last reading before the cut was not confirmed
    rows += [
        row(k, t=T0 + 420 + 2 * k, P=1800.0, W=back + 1800.0 * 2 * k / 3.6e6, boot="boot2",
            flags=["W_unconfirmed"] if k == 0 else [])
        for k in range(90)
    ]  # fmt: skip
    device = ask(stored(tmp_path, rows), "--from", utc(T0), "--to", utc(T0 + 600))["devices"][0]
    assert exact(device) and device["register_set_nWh"] == 0
    assert device["total"]["kWh"] == pytest.approx((1800.0 * 478 - 1800.0 * 0.9) / 3.6e6, rel=0.02)
    assert device["total"]["missing_s"] == pytest.approx(120, abs=3)


def test_two_daemons_under_one_name_invent_no_energy(tmp_path):
    rows = []
    for k in range(300):  # ten minutes; the registers of the daemons are 95 kWh apart
        one, other = (W + 1800.0 * 2 * k / 3.6e6 for W in (5.0, 100.0))
        rows.append(row(k, t=T0 + 2 * k, P=1800.0, W=one, flags=["two_boots"]))
        if k >= 100:
            rows.append(row(k, t=T0 + 2 * k + 1, P=1800.0, W=other, boot="boot2", flags=["two_boots"]))
    said = ask(stored(tmp_path, rows), "--from", utc(T0), "--to", utc(T0 + 600))
    device = said["devices"][0]
    assert exact(device) and device["register_set_nWh"] == pytest.approx(95e12, rel=0.001)
    assert device["total"]["kWh"] <= 1800.0 * 600 / 3.6e6 + 1e-9
    assert any("two daemons" in remark or "exchanged or set" in remark for remark in device["remarks"])


def test_the_tariff_of_the_configuration_is_used(quarters, tmp_path):
    (tmp_path / "t.toml").write_text('price = 0.1\nzone = "Europe/Berlin"\n')
    (tmp_path / "acqd.toml").write_text(f"[sink]\ndatabase = '{quarters}'\n[energy]\ntariff = 't.toml'\n")
    words = ("--from", "2026-10-05", "--to", "2026-10-06", "--json")
    done = acqd_here("energy", "--config", tmp_path / "acqd.toml", *words)
    total = json.loads(done.stdout)["total"]
    assert total["kWh"] == pytest.approx(120) and total["EUR"] == pytest.approx(12)
    without = json.loads(acqd_here("energy", "--database", quarters, "--zone", "Europe/Berlin", *words).stdout)
    assert without["total"]["EUR"] is None
