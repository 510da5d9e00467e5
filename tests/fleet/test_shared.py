"""The fleet's table and page from findings that were made up."""

import json

import pytest

from acqd.fleet import words
from acqd.fleet.page import page_of
from acqd.fleet.size import main_parameter
from acqd.fleet.summary import judged, report_of
from acqd.report import Page
from tests.browser import chromium, looks, serious_findings
from tests.fleet.findings import START_S, cause, hall, screened


def test_a_cold_hall_is_reported_once_with_its_robots_and_the_excepted(tmp_path):
    _, report = hall(tmp_path)
    (shared,) = report.shared
    members = [f"cell-{3 * k:03d}" for k in range(9)]
    assert shared["cause"] == "viscous_friction" and shared["robots"] == members and shared["p"] <= 0.01
    assert len(shared["excepted"]) == 40 - 9 - 1 and "cell-005" not in shared["excepted"]
    assert shared["perhaps"] == ["cell-004"]  # its second explanation and its onset fit; those of cell-001 do not
    assert shared["sizes"]["median"] == pytest.approx(3.4) and shared["sizes"]["unit"] == "Nm s/rad"
    assert shared["since_s"][0] == START_S + 40_000
    assert [row["shared"] for row in report.robots if row["name"] in members] == [1] * 9
    assert {row["name"] for row in report.changed if row["shared"] is None} == {"cell-001", "cell-004"}
    assert report.failed == 1 and report.tests["robots"] == 39
    json.dumps(report.as_json())


def test_a_robot_whose_loop_fails_stays_changed_and_counts_as_failed(tmp_path):
    fleet, _ = hall(tmp_path)
    rows = judged([screened("a", 1e-9), screened("b")], fleet.settings)
    report = report_of(fleet, rows, {"a": {"name": "a", "error": "killed"}})
    assert report.failed == 1 and report.changed[0]["name"] == "a"
    assert words.what(report.changed[0]) == "cause not searched: killed"


def test_a_change_before_the_first_recording_is_only_bounded(tmp_path):
    fleet, _ = hall(tmp_path)
    rows = judged([screened("a", 1e-9, START_S + 10), screened("b", 1e-9)], fleet.settings)
    report = report_of(fleet, rows, {name: cause(name, "payload") for name in "ab"})
    assert [words.since(row) for row in report.robots] == ["before 2023-11-14 22:13", "2023-11-15 00:13"]


def test_numbers_are_words_that_a_person_reads(tmp_path):
    _, report = hall(tmp_path)
    row = next(row for row in report.robots if row["name"] == "cell-000")
    assert words.what(row) == "viscous_friction (joint 2)"
    assert words.how_much(row) == "coefficient 3.00 Nm s/rad (2.60 to 3.40)"
    assert words.how_sure(row) == "q < 1e-6, cause 90 %" and words.residual(row) == "0.60 -> 2.0"
    assert words.shared_line(1, report.shared[0]).startswith(
        "shared cause 1: viscous_friction in 9 robots, since 2023-"
    )


def test_a_price_says_what_a_cause_costs_a_year(tmp_path):
    fleet, _ = hall(tmp_path)
    rows = judged([screened("a", 1e-9)], fleet.settings)
    named = cause("a", "payload")
    named["cause"]["effects"][0]["a_year"] = {"kWh": 100.0, "kWh_ci95": [80.0, 120.0], "EUR": None, "EUR_ci95": None}
    (row,) = report_of(fleet, rows, {"a": named}, 0.25).robots
    assert words.a_year(row) == "100 kWh (80.0 to 120), 25.0 EUR" and row["effects"][0]["a_year"]["EUR_ci95"] == [
        20,
        30,
    ]
    (row,) = report_of(fleet, rows, {"a": named}).robots
    assert words.a_year(row) == "100 kWh (80.0 to 120)"


def test_the_largest_power_of_a_peak_stands_for_its_size():
    peak = {
        "power 0-20 ms": {"value": -2.0, "unit": "W"}, "power 20-60 ms": {"value": 259.0, "unit": "W"},
        "energy": {"value": 900.0, "unit": "J"},
    }  # fmt: skip
    assert main_parameter(peak) == "power 20-60 ms" and main_parameter({}) is None
    mass = {"mass": {"value": 0.6, "unit": "kg"}, "centre_of_mass_m": {"value": 3.0, "unit": "m"}}
    assert main_parameter(mass) == "mass"


def test_the_page_says_what_the_table_says_and_needs_no_other_file(tmp_path):
    fleet, report = hall(tmp_path)
    closed = tmp_path / "robots" / "cell-004" / "loop" / "report.html"
    closed.parent.mkdir(parents=True)
    Page("Error of the model", simulated=True, kind="closing report").write(closed)
    for row in report.robots:
        row["report"] = row["report"] and row["report"].replace("/f/", f"{tmp_path}/")
    text = page_of(fleet, report, tmp_path).html()
    assert text.count('<a href="robots/cell-004/loop/report.html">cell-004</a>') == 2  # among the changed, among all
    assert "robots/cell-005/loop" not in text  # whose report is not there
    for said in (
        "11 robots changed, 9 of them for 1 shared cause",
        "cell-005/power.sqlite",
        "simulated data",
        "Kulldorff",
    ):
        assert said in text
    assert "src=" not in text and "<link" not in text


@pytest.mark.browser
def test_the_page_has_no_serious_finding_in_light_dark_and_on_a_phone(tmp_path):
    fleet, report = hall(tmp_path)
    page_of(fleet, report, tmp_path).write(tmp_path / "fleet.html")
    with chromium() as browser:
        for view in looks(browser):
            view.goto((tmp_path / "fleet.html").as_uri())
            assert serious_findings(view) == [] and view.errors == []
