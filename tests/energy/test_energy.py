"""`acqd energy` on rows as the sink stores them (simulated), in SQLite and PostgreSQL."""

from __future__ import annotations

import csv
import json
from datetime import UTC, datetime
from fractions import Fraction
from zoneinfo import ZoneInfo

import pytest
import sqlalchemy as sa

from acqd.energy.periods import Range, boundaries, label
from acqd.energy.statement import statement_of
from acqd.energy.stretches import Kind, nwh, stretches_of
from acqd.errors import UserError
from acqd.storage.buckets import Buckets
from acqd.storage.database import open_database, transaction
from acqd.storage.maintain import Retention, maintain
from acqd.storage.schema import power_15min
from acqd.storage.writer import Writer
from tests.commands import acqd_here, refused
from tests.storage.rows import T0, message, row

DAY = 86_400


def moment(text, zone):
    return round(datetime.fromisoformat(text).replace(tzinfo=ZoneInfo(zone)).timestamp())


@pytest.mark.parametrize(
    ("zone", "spring", "autumn"),
    [("Europe/Berlin", "2026-03-29", "2026-10-25"), ("America/New_York", "2026-03-08", "2026-11-01")],
)
def test_days_of_23_and_25_hours(zone, spring, autumn):
    local = ZoneInfo(zone)
    for text, hours in ((spring, 23), (autumn, 25)):
        begin = moment(text, zone)
        chosen = Range(begin, begin + hours * 3600)
        assert boundaries(Range(begin, begin + 3 * DAY), "day", local)[1] == chosen.end
        cuts = boundaries(chosen, "hour", local)
        assert len(cuts) == hours + 1
        assert len({label(at, "hour", local) for at in cuts[:-1]}) == hours


def buckets(W, P=360.0, minutes=None, P_min=None):
    count = len(W)
    minutes = range(count) if minutes is None else minutes
    least = P if P_min is None else P_min
    return Buckets.of([(T0 + 60 * m, 60, 1500, P, least, P + 1, w) for m, w in zip(minutes, W, strict=True)])


def test_energy_over_a_gap_belongs_to_the_period_only_if_the_gap_does():
    one = 360.0 / 60_000  # kWh a minute
    gap = buckets([1.0, 1 + one, 1 + 5 * one], minutes=[0, 1, 5])
    inside = stretches_of(gap, 0.04, [T0, T0 + 3600])
    assert inside.kind.tolist() == [Kind.KNOWN, Kind.KNOWN]
    over = stretches_of(gap, 0.04, [T0, T0 + 180, T0 + 3600])
    assert over.kind.tolist() == [Kind.KNOWN, Kind.GAP] and over.nWh[1] == nwh(1 + 5 * one) - nwh(1 + one)
    # A daemon that was off counted nothing: the power of the rows explains the whole difference.
    off = stretches_of(buckets([1.0, 1 + one, 1 + 2 * one], minutes=[0, 1, 5]), 0.04, [T0, T0 + 180, T0 + 3600])
    assert off.kind.tolist() == [Kind.KNOWN, Kind.KNOWN] and off.begin[1] == off.start[1]


def test_a_register_that_was_set_back_is_no_energy_but_export_is():
    one = 360.0 / 60_000
    back = stretches_of(buckets([5.0, 5 + one, 0.001, 0.001 + one]), 0.04, [T0, T0 + 3600])
    assert back.kind.tolist() == [Kind.KNOWN, Kind.JUMP, Kind.KNOWN]
    exporting = stretches_of(buckets([5.0, 5 - one], P=-360.0, P_min=-361.0), 0.04, [T0, T0 + 3600])
    assert exporting.kind.tolist() == [Kind.KNOWN]


@pytest.fixture
def filled(database):
    """Two devices for half an hour, one of which lacks five minutes; a row every 2 s. Ten minutes are rolled up."""
    engine = open_database(database)
    rows, W = [], 0.1
    for k in range(900):
        if not 300 <= k < 450:
            W += 360.0 * 2 / 3.6e6
        if not 300 <= k < 450:
            rows.append(row(k, t=T0 + 2 * k, P=360.0, W=W, flags=["simulated"], device="cell2"))
        rows.append(row(k, t=T0 + 2 * k, P=180.0, W=7.0 + 180.0 * 2 * (k + 1) / 3.6e6, flags=["simulated"]))
    Writer(engine).write([message(each) for each in rows])
    maintain(engine, Retention(power_days=0), T0 + 600.0)
    engine.dispose()
    return database


def test_splits_add_up_to_the_register_to_the_last_digit(filled, tmp_path):
    tariff = tmp_path / "tariff.toml"
    tariff.write_text('zone = "Europe/Berlin"\nprice = 0.3\nco2 = 0.4\n[capacity]\nprice = 100\n')
    begin, end = (datetime.fromtimestamp(at, ZoneInfo("Europe/Berlin")).isoformat() for at in (T0, T0 + 1800))
    common = ("energy", "--database", filled, "--from", begin, "--to", end, "--tariff", tariff)
    result = acqd_here(*common, "--by", "shift", "--shifts", "23:20,23:22", "--csv", tmp_path / "e.csv", "--json")
    assert result.returncode == 0, result.stderr
    told = json.loads(result.stdout)
    first, second = told["devices"]
    for device in (first, second):
        parts = sum(period["nWh"] or 0 for period in device["periods"])
        assert parts + device["over_gaps_nWh"] + device["register_set_nWh"] == device["register_nWh"]
        assert device["simulated"]
    assert first["register_nWh"] == nwh(7.0 + 180.0 * 1800 / 3.6e6) - nwh(7.0 + 180.0 * 2 / 3.6e6)
    assert first["total"]["missing_s"] == 0 and second["total"]["missing_s"] == 300
    assert first["total"]["EUR"] == pytest.approx(0.3 * first["total"]["kWh"], rel=1e-12)
    assert first["total"]["demand"]["W"] == pytest.approx(180.0, rel=0.02)
    assert second["total"]["demand"] is None  # of two quarter hours, one lacks rows and one follows the gap
    with (tmp_path / "e.csv").open() as file:
        lines = list(csv.DictReader(file))
    for device in (first, second):
        exact = sum(Fraction(line["kWh"]) for line in lines if line["device"] == device["device"] and line["kWh"])
        assert exact == Fraction(device["register_nWh"], 10**12)


def test_a_page_with_pictures_says_simulated(filled, tmp_path):
    begin, end = (datetime.fromtimestamp(at, ZoneInfo("UTC")).isoformat() for at in (T0, T0 + 1800))
    page = tmp_path / "energy.html"
    result = acqd_here("energy", "--database", filled, "--from", begin, "--to", end, "--zone", "UTC", "--html", page)
    assert result.returncode == 0, result.stderr
    text = page.read_text()
    assert "<svg" in text and "imulated" in text and "http://" not in text
    assert "no rows of the period before" in result.stdout


TARIFFS = {
    '[[time_of_use]]\nprice = 0.3\nhours = "06:00-22:00"\n': "no price for mon 00:00",
    '[[time_of_use]]\nprice = 0.3\n[[time_of_use]]\nprice = 0.2\ndays = "sun"\n': "both give a price for sun 00:00",
    "price = 0.3\nprise = 0.2\n": "prise: there is no such key",
    "price = '0.3'\n": "price: expected a number",
    "[[time_of_use]]\nprice = 1\n[[time_of_use]]\nprice = 'a'\n": "time_of_use 2.price: expected a number",
    '[series]\nfile = "huge.csv"\nunit = "EUR/MWh"\n': "line 2: value '1e400' is no price",
    '[series]\nfile = "tiny.csv"\nunit = "EUR/MWh"\n': "no value at",  # and no fraction of 10^9 digits
    'zone = "Europe/Atlantis"\nprice = 0.3\n': "Europe/Atlantis",
    'zone = ""\nprice = 0.3\n': "zone: ",
    '[series]\nfile = "comma.csv"\nunit = "EUR/MWh"\n': "line 2: 3 values, the header has 2",  # 12,5 is not 12
    '[series]\nfile = "hole.csv"\nunit = "EUR/MWh"\n': "line 6: 2026-10-20T01:00Z is followed by 2026-10-20T03:00Z",
    '[series]\nfile = "order.csv"\nunit = "EUR/MWh"\n': "does not rise",
    '[series]\nfile = "wide.csv"\nunit = "EUR/MWh"\n': "is no table of values",
    '[series]\nfile = "naive.csv"\nunit = "EUR/MWh"\n': "no offset",
    '[series]\nfile = "short.csv"\nunit = "EUR/MWh"\n': "no value at",
}


@pytest.fixture(scope="module")
def rolled_up(tmp_path_factory):
    """Eleven days of quarter hours, 1 kWh each, with two price series beside the database."""
    folder = tmp_path_factory.mktemp("rolled")
    engine = open_database(str(folder / "acqd.sqlite"))
    begin = moment("2026-10-20", "Europe/Berlin") - 900
    rows = [
        {"device": "cell1", "channel": "total", "start": begin + 900 * k, "rows": 22_500, "P": 4000.0, "P_min": 4000.0,
         "P_max": 4000.0, "W": float(k), "flagged": 0}
        for k in range(11 * 96 + 5)
    ]  # fmt: skip
    with transaction(engine) as connection:
        connection.execute(sa.insert(power_15min), rows)
    engine.dispose()
    series = {
        "hole": ("", "2026-10-20T00:00Z,1", "2026-10-20T01:00Z,1", "", "2026-10-20T03:00Z,1"),  # two lines are empty
        "order": ("2026-10-20T01:00Z,1", "2026-10-20T00:00Z,1"),
        "wide": ("1" * 140_000,),
        "huge": ("2026-10-20T00:00Z,1e400",),
        "tiny": ("2026-10-19T20:00Z,1e-999999999", "2026-10-19T21:00Z,1"),
        "comma": ("2026-10-20T00:00Z,12,5",),
        "naive": ("2026-10-20T00:00,1",),
        "short": ("2026-10-19T20:00Z,1", "2026-10-19T21:00Z,1", "2026-10-19T22:00Z,100"),
        "days": [f"{datetime.fromtimestamp(begin + 900 + 3600 * k, UTC).isoformat()},{k}" for k in range(270)],
    }
    for name, lines in series.items():
        (folder / f"{name}.csv").write_text("\n".join(["time,price", *lines]) + "\n")
    return folder


@pytest.mark.parametrize("tariff", TARIFFS)
def test_a_bad_tariff_is_one_line(rolled_up, tariff):
    path = rolled_up / "bad.toml"
    path.write_text(tariff)
    result = acqd_here(
        "energy", "--database", rolled_up / "acqd.sqlite", "--from", "2026-10-20", "--to", "2026-10-31", "--zone",
        "Europe/Berlin", "--tariff", path,
    )  # fmt: skip
    assert TARIFFS[tariff] in refused(result)


def test_day_ahead_prices_and_the_day_of_25_hours(rolled_up):
    path = rolled_up / "dayahead.toml"
    path.write_text('zone = "Europe/Berlin"\n[series]\nfile = "days.csv"\nunit = "EUR/MWh"\nsurcharge = 0.1\n')
    result = acqd_here(
        "energy", "--database", rolled_up / "acqd.sqlite", "--from", "2026-10-20", "--to", "2026-10-31", "--tariff",
        path, "--json",
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    told = json.loads(result.stdout)
    kwh = {period["period"]: period["kWh"] for period in told["periods"]}
    assert kwh["Sun 2026-10-25"] == 100.0 and kwh["Mon 2026-10-26"] == 96.0 and len(kwh) == 11
    hours = 11 * 24 + 1
    assert told["total"]["EUR"] == pytest.approx(sum(4 * (k / 1000 + 0.1) for k in range(hours)), rel=1e-12)
    assert told["total"]["demand"]["W"] == pytest.approx(4000.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--by", "decade"), "expected hour, day"),
        (("--by", "step"), "needs marks: --marks FILE.csv, or [marks] file of acqd bridge marks"),
        (("--by", "shift"), "needs --shifts"),
        (("--zone", "Mars/Base"), "Mars/Base"),
        (("--from", "2026-10-25T02:30", "--zone", "Europe/Berlin"), "exists twice"),
        (("--from", "2026-03-29T02:30", "--zone", "Europe/Berlin"), "is left out"),
        (("--device", "cell9"), "the database has cell1"),
        (("--last", "week", "--this", "week"), "exclude one another"),
    ],
)
def test_a_wrong_question_is_one_line(rolled_up, words, said):
    common = () if "--from" in words or "--last" in words else ("--from", "2026-10-20")
    to = () if "--last" in words else ("--to", "2026-10-31")
    result = acqd_here("energy", "--database", rolled_up / "acqd.sqlite", *common, *to, *words)
    assert said in refused(result)


def test_rows_of_the_running_quarter_hour_alone_have_a_remedy(tmp_path):
    """As in the first minutes of a new sink: ranges end with a quarter hour."""
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(row(0, channel="total", t=T0 + 1))])
    utc = ZoneInfo("UTC")
    for end, remedy in ((T0, ": --to 2023-11-14T22:30 includes"), (T0 - 900, "choose another period by --from")):
        chosen, earlier = Range(end - 3600, end), Range(end - 7200, end - 3600)
        with pytest.raises(UserError, match=remedy):
            statement_of(engine, (), chosen, earlier, "day", utc, (), None)
    chosen = Range(T0 - 3600, T0 + 900)
    assert statement_of(engine, (), chosen, earlier, "day", utc, (), None).accounts


def test_a_range_that_ends_before_it_begins_is_refused():
    with pytest.raises(UserError, match="ends before"):
        boundaries(Range(T0, T0), "day", ZoneInfo("UTC"))
