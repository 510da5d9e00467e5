"""Energy of today, yesterday and this week, and values as CSV."""

from __future__ import annotations

import csv
from datetime import UTC, datetime

import pytest

from acqd.daemon.energy_section import EnergySection
from acqd.errors import UserError
from acqd.storage.buckets import Kept, read_buckets
from acqd.storage.database import open_database
from acqd.storage.maintain import Retention, maintain
from acqd.storage.writer import Writer
from acqd.web.energy import EnergyOfDays
from acqd.web.export import lines
from acqd.web.history import Span, history
from tests.storage.rows import T0, message, row

THURSDAY = datetime(2023, 11, 16, 6, tzinfo=UTC).timestamp()


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """Nine days of 0.6 kWh an hour until Thursday, 07:00 of Berlin's winter, a row an hour."""
    rows = [row(k, t=THURSDAY - 9 * 86_400 + 3600 * k, W=0.6 * k, P=600.0) for k in range(9 * 24)]
    engine = open_database(str(tmp_path_factory.mktemp("week") / "p.sqlite"))
    Writer(engine).write([message(one) for one in rows])
    return engine


@pytest.fixture
def week(engine, monkeypatch):
    """The same, seen on Thursday in Berlin."""
    monkeypatch.setenv("TZ", "Europe/Berlin")
    monkeypatch.setattr("acqd.web.energy.time.time", lambda: THURSDAY)
    return engine


def test_days_begin_at_local_midnight(week):
    answer = EnergyOfDays(EnergySection()).of(week, row(0).device)
    assert answer["zone"] == "Europe/Berlin"
    assert answer["today"]["kWh"] == pytest.approx(7 * 0.6, abs=0.61)  # 07:00 in Berlin
    assert answer["yesterday"]["kWh"] == pytest.approx(24 * 0.6, abs=0.01)
    assert answer["week"]["kWh"] == pytest.approx((3 * 24 + 7) * 0.6, abs=0.61)
    assert answer["today"]["EUR"] is None
    nothing = EnergyOfDays(EnergySection()).of(week, "nobody")
    assert nothing["today"]["kWh"] is None


def test_a_tariff_says_what_they_cost(week, tmp_path):
    (tmp_path / "tariff.toml").write_text('zone = "Europe/Berlin"\n[[time_of_use]]\nprice = 0.5\n')
    answer = EnergyOfDays(EnergySection(tariff=tmp_path / "tariff.toml")).of(week, row(0).device)
    assert answer["yesterday"]["EUR"] == pytest.approx(12 * 0.6, abs=0.01)
    with pytest.raises(UserError, match="no such file"):
        EnergyOfDays(EnergySection(tariff=tmp_path / "nowhere.toml"))


def test_this_week_is_compared_with_as_much_of_the_last_one(week):
    answer = EnergyOfDays(EnergySection()).of(week, row(0).device)
    assert answer["last_week"]["kWh"] == pytest.approx(47 * 0.6)  # from the first row, on Tuesday at 07:00
    assert answer["against_last_week"]["quantity"] == "mean W"  # a day of last week lacks
    assert answer["against_last_week"]["change"] == pytest.approx(0.0, abs=0.01)
    assert answer["price"] is None and answer["standby_share"] is None and answer["trouble"] == ""


def test_prices_that_have_ended_are_said_and_the_energy_stays(week, tmp_path):
    (tmp_path / "prices.csv").write_text("time,price\n2023-11-15T00:00Z,100\n2023-11-15T01:00Z,120\n")
    (tmp_path / "tariff.toml").write_text('zone = "Europe/Berlin"\n[series]\nfile = "prices.csv"\nunit = "EUR/MWh"\n')
    answer = EnergyOfDays(EnergySection(tariff=tmp_path / "tariff.toml")).of(week, row(0).device)
    assert answer["yesterday"]["kWh"] == pytest.approx(24 * 0.6, abs=0.01) and answer["yesterday"]["EUR"] is None
    assert answer["price"] is None and "no value at" in answer["trouble"]


def test_what_was_read_is_not_read_again_and_new_rows_are_seen(tmp_path):
    """Two daemons' boots in one minute, and the same numbers with and without what is kept."""
    engine = open_database(str(tmp_path / "p.sqlite"))
    rows = [row(k, t=T0 + 0.5 * k, boot="a" if k < 500 else "b", W=0.001 * k, P=float(k)) for k in range(1000)]
    Writer(engine).write([message(one) for one in rows[:960]])
    kept = Kept()

    def read(kept=None):
        with engine.connect() as connection:
            return read_buckets(connection, "cell1", "L1", 60, T0, T0 + 540, kept)[0]

    assert len(read(kept).rows) == 8
    Writer(engine).write([message(one) for one in rows[960:980]])
    assert read(kept).rows.tolist() == [120] * 8 + [20]  # the newest bucket is not full, though alone
    Writer(engine).write([message(one) for one in rows[980:]])
    again, whole = read(kept), read()
    assert again.W == whole.W and again.rows.tolist() == whole.rows.tolist() == [120] * 8 + [40]
    assert whole.P.tolist() == [60 * (2 * k + 1) - 0.5 for k in range(8)] + [979.5]
    assert whole.P_max[4] == 599.0 and whole.W[4] == 0.599


def test_a_span_of_the_past_ends_where_it_says(tmp_path):
    engine = open_database(str(tmp_path / "p.sqlite"))
    Writer(engine).write([message(row(k, t=T0 + 10 * k, P=float(k))) for k in range(100)])
    past = history(engine, Span(row(0).device, 100, end=T0 + 500))
    (P,) = past["channels"].values()
    assert [float(k) for k in range(40, 50)] == P
    table = list(csv.DictReader("".join(lines(engine, Span(row(0).device, 100), T0 + 500)).splitlines()))
    assert [float(one["P_W"]) for one in table] == P
    assert table[0]["time"] == datetime.fromtimestamp(T0 + 400, UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    assert list(table[0]) == ["time", "channel", "Vrms_V", "Irms_A", "P_W", "S_VA", "PF", "f_Hz", "W_kWh", "flags"]
    with pytest.raises(ValueError, match="Unix seconds"):
        Span("a", 60, end=float("inf"))


def test_a_long_span_is_exported_from_roll_ups(tmp_path):
    engine = open_database(str(tmp_path / "p.sqlite"))
    Writer(engine).write([message(row(k, t=T0 + 20.0 * k, P=600.0)) for k in range(60)])
    maintain(engine, Retention(power_days=0), T0 + 3600)
    table = list(csv.DictReader("".join(lines(engine, Span(row(0).device, 3600), T0 + 1200)).splitlines()))
    assert 20 <= len(table) <= 21 and {float(one["P_W"]) for one in table} == {600.0}
    assert sum(int(one["rows"]) for one in table) == 60
