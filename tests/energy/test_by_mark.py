"""Energy by part from rows in SQL: exact sums, gaps that belong to nobody, the price of the time (simulated)."""

from __future__ import annotations

import csv
import json
import re
import warnings
from datetime import UTC, datetime
from zoneinfo import ZoneInfo

import pytest
from matplotlib.figure import Figure

from acqd.energy.by_mark import ByMark, Marked, by_mark
from acqd.energy.mark_page import mark_page
from acqd.energy.marks import read_marks
from acqd.energy.periods import Range
from acqd.energy.read import read_account
from acqd.energy.tariff import load_tariff
from acqd.storage import row_series
from acqd.storage.database import open_database
from acqd.storage.writer import Writer
from tests.commands import acqd_here, refused
from tests.storage.rows import message, row

BEGIN = int(datetime(2026, 11, 23, 6, tzinfo=UTC).timestamp())


@pytest.fixture(scope="module")
def works(tmp_path_factory):
    """Half an hour, a row a second, 3.6 kW: 1 Wh a row; rows lack from 600 s to 700 s; a restart at 900 s."""
    folder = tmp_path_factory.mktemp("works")
    rows = [
        row(k, "total", t=BEGIN + k, P=3600.0, W=0.001 * k, boot="a" if k < 900 else "b", flags=["simulated"])
        for k in range(1800) if not 600 <= k < 700
    ]  # fmt: skip
    Writer(open_database(str(folder / "p.sqlite"))).write([message(one) for one in rows])
    return folder


def test_postgresql_gives_the_same_as_sqlite(works, postgres):
    """Eight minutes around the gap."""
    rows = [row(k, "total", t=BEGIN + k, P=3600.0, W=0.001 * k) for k in range(420, 900) if not 600 <= k < 700]
    Writer(open_database(postgres)).write([message(one) for one in rows])
    marks = works / "sql.csv"
    marks.write_text(f"time,device,part\n{shown(0)},cell1,gear\n{shown(650)},cell1,shaft\n")
    span = ("--by", "part", "--marks", marks, "--zone", "UTC", "--from", shown(420), "--to", shown(900), "--json")
    one, other = (
        json.loads(acqd_here("energy", "--database", database, *span).stdout)["devices"][0]
        for database in (postgres, works / "p.sqlite")
    )
    assert one["values"] == other["values"] and one["register_nWh"] == other["register_nWh"] == 479 * 10**9
    assert one["over_gaps_nWh"] == other["over_gaps_nWh"] == 101 * 10**9


def shown(at):
    return datetime.fromtimestamp(BEGIN + at, UTC).isoformat()


def ask(folder, marks, *more):
    (folder / "marks.csv").write_text("time,part\n" + "".join(f"{shown(at)},{name}\n" for at, name in marks))
    span = ("--zone", "UTC", "--from", "2026-11-23T06:00", "--to", "2026-11-23T06:30", "--device", "cell1")
    return acqd_here(
        "energy", "--database", folder / "p.sqlite", "--by", "part", "--marks", folder / "marks.csv", *span, *more
    )


def test_parts_add_up_to_the_register_and_a_gap_over_a_mark_belongs_to_none(works):
    marks = [(100, "gear"), (300.5, "shaft"), (500, "gear"), (650, "shaft"), (1000, "")]
    (device,) = json.loads(ask(works, marks, "--json", "--csv", works / "p.csv").stdout)["devices"]
    values = {each["value"]: each for each in device["values"]}
    assert list(values) == ["gear", "shaft", None] and device["simulated"]
    assert [values[name]["visits"] for name in ("gear", "shaft", None)] == [2, 2, 2]
    assert values["gear"]["kWh"] == pytest.approx((201 + 100) / 1000)  # a row belongs to where its window begins
    assert values["shaft"]["kWh"] == pytest.approx((199 + 299) / 1000) and device["over_gaps_nWh"] > 0
    assert values["shaft"]["missing_s"] == pytest.approx(50, abs=2) and values["gear"]["missing_s"] == pytest.approx(
        50, abs=2
    )
    total = sum(each["nWh"] for each in values.values()) + device["over_gaps_nWh"] + device["register_set_nWh"]
    assert total == device["register_nWh"] and device["register_set_nWh"] == 0 and device["rows"] == 1700
    table = list(csv.DictReader((works / "p.csv").read_text().splitlines()))
    assert sum(float(one["kWh"]) for one in table) == pytest.approx(1.799)


def test_a_gap_within_a_part_belongs_to_it_and_prices_are_those_of_the_time(works, tmp_path):
    (tmp_path / "t.toml").write_text(
        'zone = "UTC"\n[[time_of_use]]\nprice = 0.1\nhours = "00:00-06:15"\n'
        '[[time_of_use]]\nprice = 0.3\nhours = "06:15-24:00"\n'
    )
    done = ask(works, [(0, "gear")], "--json", "--tariff", tmp_path / "t.toml")
    (device,) = json.loads(done.stdout)["devices"]
    (gear,) = device["values"]
    assert gear["nWh"] == device["register_nWh"] and device["over_gaps_nWh"] == 0
    assert gear["EUR"] == pytest.approx(0.1 * 0.899 + 0.3 * 0.9)
    (tmp_path / "t.toml").write_text((tmp_path / "t.toml").read_text().replace("06:15", "06:11"))
    ask(works, [(0, "gear")], "--json", "--tariff", tmp_path / "t.toml", "--csv", tmp_path / "p.csv")
    (line,) = csv.DictReader((tmp_path / "p.csv").read_text().splitlines())
    assert float(line["unpriced_kWh"]) == pytest.approx(0.101)  # the price changes in the gap
    assert "gear" in ask(works, [(0, "gear")]).stdout


def stored(folder, powers, step_s, lacking=()):
    """Rows of one device from BEGIN on, each `step_s` s long, with these powers [W]; the register counts all."""
    rows, W = [], 5.0
    for k, P in enumerate(powers):
        W += P * step_s / 3.6e6
        if k not in lacking:
            rows.append(row(k, "total", t=BEGIN + step_s * k, P=P, W=W))
    engine = open_database(str(folder / "p.sqlite"))
    Writer(engine).write([message(one) for one in rows])
    return engine


def of_parts(path, *marks):
    path.write_text("time,part\n" + "".join(f"{shown(at)},{name}\n" for at, name in marks))
    return read_marks(path, "part")[""]


def test_parts_cost_what_the_quarter_hours_of_the_device_cost(tmp_path):
    """A gear that takes 2 kW and a brake test that gives back 3 kW share quarter hours that export on balance."""
    engine = stored(tmp_path, [(2000.0, -3000.0)[k // 30 % 2] for k in range(180)], 10)
    marks = of_parts(tmp_path / "m.csv", *[(300 * k, ("gear", "brake test")[k % 2]) for k in range(6)])
    (tmp_path / "t.toml").write_text("price = 0.3\nfeed_in = 0.08\n")
    tariff = load_tariff(tmp_path / "t.toml")
    parts = by_mark(engine, "cell1", marks, BEGIN, BEGIN + 1800, tariff)
    account = read_account(engine, "cell1", [BEGIN, BEGIN + 900, BEGIN + 1800], tariff)
    assert sum(each.cost for each in parts.values) == account.total.cost
    first, second = account.periods
    assert first.cost > 0 > second.cost  # two gears and a brake test; two brake tests and a gear
    assert sum(each.nWh for each in parts.values) == parts.register_nWh == account.register_nWh


def test_what_a_gap_may_hold_follows_from_all_rows_and_not_from_those_read_with_it(tmp_path, monkeypatch):
    """A night at 5 kW, a gap in which the work at 300 kW began, and the rest, read in small pieces."""
    monkeypatch.setattr(row_series, "_AT_ONCE", 20)
    engine = stored(tmp_path, [5e3] * 50 + [3e5] * 50 + [5e3] * 30 + [3e5] * 30, 10, lacking=range(50, 100))
    found = by_mark(engine, "cell1", of_parts(tmp_path / "m.csv", (0, "gear")), BEGIN, BEGIN + 1800, None)
    assert found.jumps_nWh == 0 and found.values[0].nWh == found.register_nWh


@pytest.mark.parametrize(
    ("text", "why"),
    [("time,part\n2026-11-23T06:00,gear\n", "line 2: time '2026-11-23T06:00' has no offset"),
     ("time,part,Part\n2026-11-23T06:00Z,a,b\n", "has two columns part"),
     ("time,what\n", "has no column part"), ("time,part\n", "has no lines"),
     ("time,part\n2026-11-23T06:00Z,a\n2026-11-23T06:00Z,b\n", "line 3: time does not rise"),
     ("time,part,device\n2026-11-23T06:00Z,a,x\n", "has lines of x"),
     (f"time,part\n2026-11-23T06:00Z,{'a' * 140_000}\n", "is no table of values")],
)  # fmt: skip
def test_marks_that_cannot_be_used_are_one_line(works, tmp_path, text, why):
    (tmp_path / "m.csv").write_text(text)
    words = ("--database", works / "p.sqlite", "--device", "cell1", "--by", "part", "--marks", tmp_path / "m.csv")
    assert why in refused(acqd_here("energy", *words))


def test_marks_without_a_device_are_those_of_the_only_one(works, tmp_path):
    (tmp_path / "m.csv").write_text(f"time,part\n{shown(0)},gear\n")
    span = ("--zone", "UTC", "--from", shown(0), "--to", shown(600), "--by", "part", "--marks", tmp_path / "m.csv")
    (device,) = json.loads(acqd_here("energy", "--database", works / "p.sqlite", *span, "--json").stdout)["devices"]
    assert device["device"] == "cell1" and device["rows"] == 600


def test_a_line_that_repeats_the_value_is_no_new_visit(works):
    marks = [(0, ""), (100, "gear"), (200, "gear"), (690, "gear"), (900, "")]
    (device,) = json.loads(ask(works, marks, "--json").stdout)["devices"]
    assert {each["value"]: each["visits"] for each in device["values"]} == {"gear": 1, None: 2}
    assert device["over_gaps_nWh"] == 0  # the gap lies within the visit


def test_by_part_without_marks_says_what_is_needed(works):
    assert "--marks FILE.csv" in refused(acqd_here("energy", "--database", works / "p.sqlite", "--by", "part"))
    words = ("energy", "--database", works / "p.sqlite", "--by", "day", "--marks", works / "m.csv")
    assert "goes with --by" in refused(acqd_here(*words))


def test_the_page_has_every_value_and_the_check_of_the_sums(works, tmp_path):
    page = tmp_path / "p.html"
    done = ask(works, [(0, "gear <b>"), (300.5, "shaft"), (650, "shaft 2"), (1000, "")], "--html", page)
    text = page.read_text()
    assert f"written: {page}" in done.stdout and "gear &lt;b&gt;" in text and "<svg" in text and "over gaps" in text
    assert "simulated" in text.lower() and "1.799" in text


def test_names_are_text_in_the_picture(tmp_path, monkeypatch):
    """Two $ are no formula of matplotlib, and letters that its font lacks are the page's."""
    monkeypatch.setattr(Figure, "savefig", Figure.savefig.__wrapped__)  # with ticks, as users get it
    names = ["P$1_{$", "ギア", "a^b_c"]
    values = [Marked(name, visits=1, seconds=10, known_s=10, nWh=10**9) for name in names]
    one = ByMark("cell-1", "total", values, 0, 0, 3 * 10**9, 100, simulated=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mark_page([one], "part", Range(BEGIN, BEGIN + 3600), ZoneInfo("UTC")).write(tmp_path / "p.html")
    shown = re.findall(r">([^<]*)</text>", (tmp_path / "p.html").read_text())
    assert [name for name in shown if name in names] == names


def test_devices_that_nobody_meters_are_named_and_left_out(works, tmp_path):
    path = tmp_path / "m.csv"
    path.write_text(f"time,device,part\n{shown(0)},washer-7,a\n{shown(0)},cell1,gear\u2028large\n")
    words = ("energy", "--database", works / "p.sqlite", "--by", "part", "--marks", path, "--zone", "UTC",
             "--from", "2026-11-23T06:00", "--to", "2026-11-23T06:30")  # fmt: skip
    done = acqd_here(*words, "--json", "--html", tmp_path / "p.html")
    answer = json.loads(done.stdout)
    assert [one["device"] for one in answer["devices"]] == ["cell1"] and answer["without_rows"] == ["washer-7"]
    assert "left out: washer-7" in done.stderr and "washer-7" in (tmp_path / "p.html").read_text()
    assert "device 'washer-7' has no rows" in refused(acqd_here(*words, "--device", "washer-7"))
    path.write_text(f"time,device,part\n{shown(0)},washer-7,a\n{shown(0)},washer-8,a\n")
    assert "no device of the marks has rows in this period: washer-7, washer-8" in refused(acqd_here(*words))


def test_marks_of_the_bridge_are_those_of_the_configuration(works, tmp_path):
    (tmp_path / "m.csv").write_text(f"time,device,program,step,part,state\n{shown(0)},cell1,p,1,gear,\n")
    (tmp_path / "acqd.toml").write_text(
        f"[sink]\ndatabase = '{works / 'p.sqlite'}'\n[marks]\nfile = '{tmp_path / 'm.csv'}'\n"
    )
    span = ("--zone", "UTC", "--from", "2026-11-23T06:00", "--to", "2026-11-23T06:30")
    for by, value in (("part", "gear"), ("step", "1"), ("program", "p")):
        done = acqd_here("energy", "--config", tmp_path / "acqd.toml", "--by", by, *span, "--json")
        ((only,),) = [each["values"] for each in json.loads(done.stdout)["devices"]]
        assert only["value"] == value
    assert "cell1" in acqd_here("energy", "--config", tmp_path / "acqd.toml", "--by", "day", *span).stdout
