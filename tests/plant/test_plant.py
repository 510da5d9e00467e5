"""The plant's page, its month and its inventory: a real broker and a database of quarter hours (simulated)."""

from __future__ import annotations

import json
import re
from datetime import datetime
from zoneinfo import ZoneInfo

import aiomqtt
import pytest
import sqlalchemy as sa

from acqd.energy.rules import Rules
from acqd.errors import UserError
from acqd.fleet.summary import judged, report_of
from acqd.plant.heard import Heard
from acqd.plant.inventory import inventory
from acqd.plant.month import month_page, month_range, read_month
from acqd.plant.page import plant_page
from acqd.plant.plant import read_plant
from acqd.plant.remembered import file_of, remember
from acqd.storage.database import open_database, read_database, transaction
from acqd.storage.schema import power_15min
from acqd.storage.writer import Writer
from tests.browser import chromium, looks, serious_findings
from tests.commands import acqd_here, refused
from tests.fleet.findings import START_S, cause, screened
from tests.integrations.messages import status
from tests.storage.rows import message, row
from tests.waiting import finish

BERLIN = ZoneInfo("Europe/Berlin")


def unix(text):
    return round(datetime.fromisoformat(text).replace(tzinfo=BERLIN).timestamp())


NOW = unix("2026-11-26T12:00")


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """Statuses are remembered there."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """Four devices from 20 October: 1 kW, of cell-2 2 kW in the last week; cell-3 has a gap, cell-4 ends."""
    folder = tmp_path_factory.mktemp("plant")
    rows = []
    for k in range(1, 5):
        W = 0.0
        for start in range(unix("2026-10-20"), NOW, 900):
            P = 2000.0 if k == 2 and start >= unix("2026-11-19") else 1000.0
            W += P / 4000
            gap = k == 3 and unix("2026-11-20T22:00") <= start < unix("2026-11-21T06:00")
            if not gap and not (k == 4 and start >= unix("2026-11-10")):
                rows.append({"device": f"cell-{k}", "channel": "total", "start": start, "rows": 22_500, "P": P,
                             "P_min": P, "P_max": P, "W": W, "flagged": 0})  # fmt: skip
    engine = open_database(str(folder / "p.sqlite"))
    with transaction(engine) as connection:
        connection.execute(sa.insert(power_15min), rows)
    (folder / "tariff.toml").write_text(
        'name = "works"\nprice = 0.25\nzone = "Europe/Berlin"\n[capacity]\nprice = 10.0\nper = "month"\n'
    )
    (folder / "bare.toml").write_text('[sink]\ndatabase = "p.sqlite"\n[energy]\nzone = "Europe/Berlin"\n')
    (folder / "acqd.toml").write_text('[sink]\ndatabase = "p.sqlite"\n[energy]\ntariff = "tariff.toml"\n')
    return folder


@pytest.fixture(scope="module")
def fleet(plant):
    """What `acqd fleet` has found: cell-2 changed a week ago, with a report."""
    from acqd.fleet.config import read_fleet

    (plant / "fleet.toml").write_text("[defaults]\nmodel = 'm'\ndataset = 'd'\n[robots.two]\ndevice = 'cell-2'\n")
    described = read_fleet(plant / "fleet.toml")
    (plant / "loop").mkdir()
    (plant / "loop" / "report.html").write_text("<h1>closed</h1>")
    named = cause("two", "viscous_friction")
    named["cause"]["report"] = str(plant / "loop" / "report.html")
    named["cause"]["effects"][0]["a_year"] = {"kWh": 100.0, "kWh_ci95": [80.0, 120.0], "EUR": None, "EUR_ci95": None}
    onset = unix("2026-11-19T06:00")
    changed = screened("two", 1e-9, onset)
    changed["screen"] |= {"first_s": START_S, "first_end_s": START_S + 60}
    report = report_of(described, judged([changed], described.settings), {"two": named}, 0.25)
    (plant / "found").mkdir()
    (plant / "found" / "report.json").write_text(json.dumps(report.as_json()))
    return plant / "found"


@pytest.fixture
def ask(plant, monkeypatch):
    """Run `acqd plant` in the folder of the plant, on Thursday at noon."""
    monkeypatch.setattr("acqd.cli.plant.time.time", lambda: float(NOW))

    def run(*words):
        return acqd_here("plant", *words, "--json", cwd=plant)

    return run


def announced(port):
    alarm = {"key": "cell-1/residual", "text": "cell-1: measured power no longer follows the model",
             "since": "2026-11-25T08:30:00.000Z", "acknowledged_by": "", "details": {}}  # fmt: skip
    known = alarm | {"key": "hall/spool", "text": "hall: the spool is nearly full", "acknowledged_by": "Ada"}
    messages = [
        status("hall", version="2.9.0", started="2026-11-01T00:00:00Z", name={"host": "pc-7"},
               meters={"cell-3": {}, "cell-2": {}}),
        status("cell-1", version="2.10.0"), ("acqd/cell-4/status", b"offline"),
        ("acqd/sink/s1/status", b'{"state":"online","version":"2.10.0","host":"db"}'),
        ("acqd/alarms/active", json.dumps([alarm, known]).encode()),
    ]  # fmt: skip

    async def publish():
        async with aiomqtt.Client("127.0.0.1", port) as client:
            for topic, payload in messages:
                await client.publish(topic, payload, qos=1, retain=True)

    finish(publish())
    return messages


def test_every_device_has_its_alarm_its_cost_and_its_report(plant, fleet, ask, mosquitto):
    announced(mosquitto.port)
    (plant / "live.toml").write_text((plant / "acqd.toml").read_text() + f"[mqtt]\nport = {mosquitto.port}\n")
    done = ask("page", "--fleet", fleet, "--out", plant / "plant.html", "--config", plant / "live.toml")
    rows = {row["device"]: row for row in json.loads(done.stdout)["devices"]}
    assert list(rows) == ["cell-1", "cell-4", "cell-2", "cell-3"]
    assert {name: row["severity"] for name, row in rows.items()} == {
        "cell-1": "alarm", "cell-4": "no rows", "cell-2": "acknowledged", "cell-3": "acknowledged",
    }  # fmt: skip
    assert (rows["cell-1"]["state"], rows["cell-4"]["state"], rows["cell-2"]["state"]) == (
        "online", "offline", "online",
    )  # fmt: skip
    two = rows["cell-2"]
    assert two["kWh"] == pytest.approx(48) and two["EUR"] == pytest.approx(12) and two["change"] == pytest.approx(1)
    assert "viscous_friction" in two["cause"] and two["acknowledged_by"] == "Ada" and two["report"]
    three = rows["cell-3"]
    assert three["kWh"] == pytest.approx(24) and three["missing_s"] == pytest.approx(8 * 3600)
    assert three["days"][7:11] == [24.0, None, None, 24.0]  # the night that lacks belongs to two days
    assert rows["cell-4"]["kWh"] is None and rows["cell-1"]["since"] == "2026-11-25 08:30"
    page = (plant / "plant.html").read_text()
    assert 'href="loop/report.html"' in page and "2 devices without rows or with an open alarm" in page


def test_without_a_broker_or_a_tariff_nothing_is_invented(plant, ask):
    done = ask("page", "--no-broker", "--config", plant / "bare.toml", "--out", plant / "bare.html")
    rows = {row["device"]: row for row in json.loads(done.stdout)["devices"]}
    assert {row["EUR"] for row in rows.values()} == {None} and {row["state"] for row in rows.values()} == {"not asked"}
    assert rows["cell-1"]["severity"] == "unknown" and "The broker was not asked" in (plant / "bare.html").read_text()
    page = (plant / "bare.html").read_text()
    assert "without rows or with an open alarm" in page and "No open alarm" not in page
    shown = acqd_here("plant", "page", "--no-broker", "--config", plant / "bare.toml", cwd=plant)
    assert "4 devices (1 no rows, 3 unknown): " in shown.stdout
    assert "acqd fleet writes the folder" in refused(
        ask("page", "--no-broker", "--config", plant / "bare.toml", "--fleet", plant / "nowhere")
    )


def test_a_month_is_printed_with_what_is_missing(plant, fleet, ask):
    done = ask("month", "--month", "2026-11", "--fleet", fleet, "--out", plant / "month.html")
    found = json.loads(done.stdout)
    days = 25.5
    expected = 24 * (3 * days + 7.5) + 24 * 9
    assert found["kWh"] == pytest.approx(expected) and found["EUR"] == pytest.approx(0.25 * expected)
    page = (plant / "month.html").read_text().replace("\N{NO-BREAK SPACE}", " ")
    assert "2 devices lack rows" in page and "no rows" not in page.split("Devices</h2>")[1].split("</table>")[0]
    assert "viscous_friction" in page and "100 kWh (80.0 to 120), 25.0 EUR" in page
    assert "50.00 EUR" in page  # 10 EUR for each kW of the highest quarter hours: 1 + 2 + 1 + 1 kW
    default = json.loads(ask("month").stdout)
    assert default["month"] == "2026-10" and default["page"] == "plant-2026-10.html"
    for month, why in (
        ("2026-1", "like 2026-10"),
        ("2027-01", "not begun"),
        ("2026-13", "expected"),
        ("2026-08", "no device"),
    ):
        assert why in refused(ask("month", "--month", month, "--config", plant / "bare.toml"))


def plant_heard(plant, now=NOW, **topics):
    """The plant as of `now`, with these retained messages."""
    heard = Heard()
    for topic, payload in topics.items():
        heard.take("acqd/" + topic.replace("__", "/"), payload)
    engine = read_database(str(plant / "p.sqlite"))
    return read_plant(engine, Rules(None, BERLIN), now, heard, {}, lambda *_: None)


def test_an_alarm_that_belongs_to_no_row_is_told(plant):
    alarm = {"text": "the daemon is offline", "since": "2026-11-26T09:30:00.000Z", "acknowledged_by": ""}
    active = [alarm | {"key": "hall-1/offline"}, alarm | {"key": "all/budget-day-kWh", "acknowledged_by": "Ada"},
              alarm | {"key": "gone/residual"}, alarm | {"key": "cell-1/residual"}]  # fmt: skip
    one = [status(f"cell-{k}")[1] for k in range(1, 5)]
    daemons = {f"cell-{k}__status": payload for k, payload in enumerate(one, 1)}
    found = plant_heard(plant, **daemons, **{"hall-1__status": b"offline"}, alarms__active=json.dumps(active).encode())
    assert [each["key"] for each in found.loose] == ["hall-1/offline", "all/budget-day-kWh", "gone/residual"]
    plant_page(found, plant / "loose.html").write(plant / "loose.html")
    page = (plant / "loose.html").read_text()
    assert "2 open alarms of no device in the table" in page and "all/budget-day-kWh" in page
    without = plant_heard(plant, unix("2026-11-09T12:00"), **daemons, **{"hall-1__status": b"offline"})
    assert [each["key"] for each in without.loose] == ["hall-1/offline"]  # acqd alarms does not run
    plant_page(without, plant / "loose.html").write(plant / "loose.html")
    page = (plant / "loose.html").read_text()
    assert "1 open alarm of no device in the table" in page and "No open alarm" not in page


@pytest.mark.parametrize("days", [1, 3, 20])
def test_an_online_device_whose_rows_have_ended_is_not_fine(plant, days):
    daemons = {f"cell-{k}__status": status(f"cell-{k}")[1] for k in range(1, 5)}
    now = NOW + days * 86_400
    found = plant_heard(plant, now, **daemons, sink__s1__status=b"offline", alarms__active=b"[]")
    expected = {"cell-1": "fine", "cell-4": "no rows"} if days == 1 else {"cell-1": "no rows", "cell-4": "no rows"}
    assert {row.device: row.severity for row in found.rows}.items() >= expected.items()
    plant_page(found, plant / "ended.html").write(plant / "ended.html")
    assert "The sink s1 is offline" in (plant / "ended.html").read_text()
    before = plant_heard(plant, unix("2026-10-20T12:00"), **daemons, alarms__active=b"[]")
    assert {row.severity for row in before.rows} == {"fine"}  # the first day is not over


def quarters(path, *of):
    """Quarter hours of 1 kW: device, begin, end."""
    engine = open_database(str(path))
    rows = [{"device": name, "channel": "total", "start": start, "rows": 22_500, "P": 1000.0, "P_min": 1000.0,
             "P_max": 1000.0, "W": (start - unix("2026-08-01")) / 3600, "flagged": 0}
            for name, begin, end in of for start in range(unix(begin), unix(end), 900)]  # fmt: skip
    with transaction(engine) as connection:
        connection.execute(sa.insert(power_15min), rows)
    return engine


@pytest.mark.parametrize("simulated", [False, True])
def test_pages_of_simulated_devices_say_so_on_the_first_day_and_where_rows_are_deleted(tmp_path, simulated):
    """`press-1` has roll-ups of October and a row of today, `press-2` rows of today alone."""
    engine = quarters(tmp_path / "p.sqlite", ("press-1", "2026-10-01", "2026-11-01"))
    flags = ["simulated"] if simulated else []
    rows = [row(k, t=NOW - 60 + k, device=name, flags=flags) for name in ("press-1", "press-2") for k in range(5)]
    Writer(engine).write([message(one) for one in rows])
    read = read_plant(engine, Rules(None, BERLIN), NOW, None, {}, lambda *_: None)
    assert [one.simulated for one in read.rows] == [simulated] * 2
    month = read_month(engine, Rules(None, BERLIN), *month_range("2026-10", NOW, BERLIN), {}, lambda *_: None)
    for page in (plant_page(read, tmp_path / "a.html"), month_page(month, tmp_path / "a.html")):
        (tmp_path / "a.html").unlink(missing_ok=True)
        page.write(tmp_path / "a.html")
        assert ('class="label">simulated data<' in (tmp_path / "a.html").read_text()) is simulated


def test_what_nobody_was_asked_for_is_not_fine(tmp_path):
    engine = quarters(tmp_path / "p.sqlite", ("press-1", "2026-11-01", "2026-11-26T12:00"))
    read = read_plant(engine, Rules(None, BERLIN), NOW, None, {}, lambda *_: None)
    plant_page(read, tmp_path / "a.html").write(tmp_path / "a.html")
    page = (tmp_path / "a.html").read_text()
    assert "Alarms are unknown" in page and "No open alarm" not in page
    assert "+0.0 %" in page.replace("\N{NO-BREAK SPACE}", " ") and "-0.0" not in page


def test_a_month_without_rows_names_those_with_rows(tmp_path):
    engine = quarters(tmp_path / "p.sqlite", ("a", "2026-01-05", "2026-01-06"), ("b", "2026-03-30", "2026-05-02"))
    with pytest.raises(
        UserError, match="no device has rows in 2026-02; rows are stored in 2026-01, 2026-03 to 2026-05"
    ):
        read_month(engine, Rules(None, BERLIN), *month_range("2026-02", NOW, BERLIN), {}, lambda *_: None)
    empty = open_database(str(tmp_path / "empty.sqlite"))
    with pytest.raises(UserError, match="`acqd sink` stores them"):
        read_month(empty, Rules(None, BERLIN), *month_range("2026-02", NOW, BERLIN), {}, lambda *_: None)


def test_a_month_that_has_just_begun_says_when_its_rows_count(tmp_path):
    engine = quarters(tmp_path / "p.sqlite", ("a", "2026-11-01T06:00", "2026-11-01T06:15"))
    chosen, earlier = month_range("2026-11", unix("2026-11-01T06:00"), BERLIN)
    with pytest.raises(UserError, match="2026-11 has rows of the running quarter hour only"):
        read_month(engine, Rules(None, BERLIN), chosen, earlier, {}, lambda *_: None)


def test_a_month_of_one_day_shows_a_bar(tmp_path):
    engine = quarters(tmp_path / "p.sqlite", ("a", "2026-11-01", "2026-11-01T06:00"))
    read = read_month(engine, Rules(None, BERLIN), *month_range("2026-11", unix("2026-11-01T06:00"), BERLIN), {},
                      lambda *_: None)  # fmt: skip
    month_page(read, tmp_path / "m.html").write(tmp_path / "m.html")
    assert re.search(r'class="bar after" d="M[\d. ]+V', (tmp_path / "m.html").read_text())


def test_a_device_without_a_row_in_the_month_is_named(tmp_path):
    engine = quarters(tmp_path / "p.sqlite", ("press-1", "2026-09-01", "2026-11-01"),
                      ("press-3", "2026-09-01", "2026-09-05"))  # fmt: skip
    found = read_month(engine, Rules(None, BERLIN), *month_range("2026-10", NOW, BERLIN), {}, lambda *_: None)
    assert found.gone == ["press-3"] and [one.device for one in found.accounts] == ["press-1"]
    month_page(found, tmp_path / "m.html").write(tmp_path / "m.html")
    page = (tmp_path / "m.html").read_text()
    assert "No row in this month, but in the month before: press-3." in page and "whole month are there" not in page
    assert "press-3" in page.split("Devices</h2>")[1].split("</table>")[0]


def test_a_cost_of_which_a_part_is_unknown_is_a_lower_bound(tmp_path):
    """The series ends on 3 October; press-2 goes on, press-1 does not."""
    quarters(tmp_path / "p.sqlite", ("press-1", "2026-10-01", "2026-10-03"), ("press-2", "2026-10-01", "2026-10-05"))
    (tmp_path / "prices.csv").write_text(
        "time,price\n" + "".join(f"2026-10-0{k // 24 + 1}T{k % 24:02d}:00+02:00,500\n" for k in range(48))
    )
    (tmp_path / "t.toml").write_text('zone = "Europe/Berlin"\n[series]\nfile = "prices.csv"\nunit = "EUR/MWh"\n')
    (tmp_path / "acqd.toml").write_text('[sink]\ndatabase = "p.sqlite"\n[energy]\ntariff = "t.toml"\n')
    asked = ("plant", "month", "--month", "2026-10", "--out", tmp_path / "m.html", "--config", tmp_path / "acqd.toml")
    found = json.loads(acqd_here(*asked, "--json", cwd=tmp_path).stdout)
    assert found["kWh"] == pytest.approx(48 + 96, abs=0.5) and found["EUR"] == pytest.approx(24, abs=0.3)
    assert found["unpriced_kWh"] == pytest.approx(96, abs=0.5) and "no value at" in found["trouble"]
    shown = acqd_here(*asked, cwd=tmp_path).stdout
    assert ">= 23." in shown and "note: " in shown and "no value at" in shown


def test_a_running_month_is_compared_with_as_much_of_the_month_before():
    chosen, earlier = month_range("2026-11", NOW, BERLIN)
    assert (chosen.begin, chosen.end) == (unix("2026-11-01"), NOW)
    assert (earlier.begin, earlier.end) == (unix("2026-10-01"), unix("2026-10-26T12:00"))
    chosen, _ = month_range("2026-11", unix("2026-11-01") + 60, BERLIN)
    assert chosen.end == unix("2026-11-01T00:15")  # its first quarter hour is no error of --from and --to
    assert month_range("2026-10", NOW, BERLIN)[1].end == unix("2026-10-01")


def test_an_inventory_names_what_is_offline_or_old(plant, ask, mosquitto):
    announced(mosquitto.port)
    (plant / "live.toml").write_text((plant / "acqd.toml").read_text() + f"[mqtt]\nport = {mosquitto.port}\n")
    done = ask("inventory", "--config", plant / "live.toml")
    found = {one["name"]: one for one in json.loads(done.stdout)}
    assert done.returncode == 1 and found["cell-4"]["online"] is False
    hall = found["hall"]
    assert (hall["host"], hall["version"], sorted(hall["devices"])) == ("pc-7", "2.9.0", ["cell-2", "cell-3"])
    assert hall["remarks"] == ["older than 2.10.0"] and found["s1"]["kind"] == "sink" and found["s1"]["host"] == "db"
    shown = acqd_here("plant", "inventory", "--config", plant / "live.toml")
    assert "4 processes, 3 online, versions: 2.10.0, 2.9.0" in shown.stdout


def heard_of(*messages):
    heard = Heard()
    for topic, payload in messages:
        heard.take(topic, payload)
    return heard


def test_what_goes_offline_keeps_host_version_and_devices(tmp_path):
    file, sink = tmp_path / "new" / "plant.json", "acqd/sink/s1/status"
    boxes = {"cell-5": {"meters": {"cell-6": {"P": 3.0}}}}
    hall = status("hall", version="2.9.0", name={"host": "pc-7"}, boxes=boxes, rows=7)
    remember(heard_of(hall, (sink, b'{"state":"online","version":"2.10.0","host":"db"}')), file)
    heard = heard_of(("acqd/hall/status", b"offline"), (sink, b"offline"), ("acqd/new/status", b"offline"))
    assert heard.daemon_of("cell-6") is None
    remember(heard, file)
    assert heard.daemon_of("cell-6") == heard.daemon_of("cell-5") == "hall" and heard.daemons["hall"] is None
    found = {one.name: one for one in inventory(heard)}
    assert [(found[name].host, found[name].version, found[name].online) for name in ("hall", "s1", "new")] == [
        ("pc-7", "2.9.0", False), ("db", "2.10.0", False), ("", "", False),
    ]  # fmt: skip
    assert found["hall"].devices == ("cell-6",)  # the box has no rows of its own
    assert "rows" not in file.read_text()  # names only


@pytest.mark.parametrize("old", ["hall-old", "cell-1"])
def test_a_device_is_that_of_the_daemon_that_is_online(tmp_path, old):
    file, cells = tmp_path / "plant.json", {"cell-1": {}, "cell-2": {}}
    remember(heard_of(status(old, meters=cells)), file)
    gone = (f"acqd/{old}/status", b"offline")
    for messages in ([gone, status("hall", meters=cells)], [status("hall", meters=cells), gone]):
        heard = heard_of(*messages)
        remember(heard, file)
        assert heard.daemon_of("cell-1") == heard.daemon_of("cell-2") == "hall"
    alone = heard_of(gone)
    remember(alone, file)
    assert alone.daemon_of("cell-1") == alone.daemon_of("cell-2") == old


def test_a_user_without_a_home_has_no_memory(monkeypatch, tmp_path):
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setattr("acqd.plant.remembered.Path.home", lambda: (_ for _ in ()).throw(RuntimeError))
    assert file_of("b:1883") is None
    remember(heard_of(("acqd/hall/status", b"offline")), None)
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    assert file_of("b:1883") == tmp_path / "plant-b-1883.json"


def test_a_status_of_any_depth_is_remembered_to_the_meters_of_a_box(tmp_path):
    deep = '{"boxes":{"a":' * 500 + "{}" + "}}" * 500
    heard = heard_of(("acqd/hall/status", deep.replace("{", '{"version":"2","name":[' + "[" * 9 + "]" * 9 + "],", 1)))
    remember(heard, tmp_path / "plant.json")
    assert json.loads((tmp_path / "plant.json").read_bytes())["daemons"]["hall"]["boxes"] == {"a": {"boxes": {"a": {}}}}
    (tmp_path / "plant.json").write_text('{"daemons": {"hall": ' + deep + "}}")
    for _ in range(2):
        heard = heard_of(("acqd/hall/status", b"offline"))
        remember(heard, tmp_path / "plant.json")
        assert heard.daemon_of("a") == "hall"


@pytest.mark.parametrize("content", [b"", b"[]", b'{"daemons": 3}', b'{"daemons": {"hall": 4}}'])
def test_a_damaged_memory_is_none(tmp_path, content):
    (tmp_path / "plant.json").write_bytes(content)
    heard = heard_of(("acqd/hall/status", b"offline"))
    remember(heard, tmp_path / "plant.json")
    assert [(one.host, one.online) for one in inventory(heard)] == [("", False)]


@pytest.mark.parametrize("payload", [b"", b"[]", b"{", b"5", b'{"boxes": 3, "meters": {"a": null}, "name": 4}'])
def test_any_status_is_read(payload):
    heard = Heard()
    for topic in ("acqd/x/status", "acqd/sink/x/status", "acqd/alarms/active", "acqd/x/y/z"):
        heard.take(topic, payload)
    assert len(inventory(heard)) == 2


def sorted_by_keyboard(page):
    page.focus("th:has-text('kWh a day') button")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    assert page.locator("tbody th").all_inner_texts() == ["cell-2", "cell-1", "cell-3", "cell-4"]
    page.fill("input[type=search]", "viscous")
    assert page.locator("tbody tr:visible").count() == 1 and "1 row" in page.inner_text("label.filter")


@pytest.mark.browser
def test_the_pages_are_accessible_sorted_by_keyboard_and_fit_a_phone(plant, fleet, ask):
    ask("page", "--no-broker", "--fleet", fleet, "--out", plant / "seen.html")
    ask("month", "--month", "2026-11", "--fleet", fleet, "--out", plant / "seen-month.html")
    with chromium() as browser:
        for view in looks(browser):
            view.goto((plant / "seen.html").as_uri())
            assert serious_findings(view) == [] and view.errors == []
            if view.rules is None:  # the other looks are those of every report
                sorted_by_keyboard(view)
                view.goto((plant / "seen-month.html").as_uri())
                assert serious_findings(view) == [] and view.errors == []
