"""`acqd plan` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from acqd.planning.measured import shipped
from tests.commands import acqd_here, refused

SCALING = Path(__file__).parents[2] / "docs" / "scaling.md"


def test_the_page_shows_what_the_command_prints(tmp_path):
    printed = acqd_here("plan", "200", cwd=tmp_path).stdout
    assert max(map(len, printed.splitlines())) <= 110
    assert f"```text\n{printed}```" in SCALING.read_text(encoding="utf-8")


def test_all_lines_fit_110_columns_with_everything_asked_for(tmp_path):
    everything = ["--quality", "10/12", "--archive", "30", "--disk", "900000", "--boxes", "40", "--load", "0.8"]
    printed = acqd_here("plan", "10000", *everything, cwd=tmp_path).stdout
    assert max(map(len, printed.splitlines())) <= 110
    assert "retention that fits" in printed and "over 8 not measured" in printed


def test_figures_of_another_computer_replace_those_of_the_package(tmp_path):
    figures = [
        {"section": one.section + "of mine", "name": one.name, "value": 2 * one.value, "unit": one.unit}
        for one in shipped().values()
        if one.section.startswith("50 devices")
    ]
    (tmp_path / "fleet.json").write_text(json.dumps(figures))
    plain = json.loads(acqd_here("plan", "200", "--json", cwd=tmp_path).stdout)
    mine = json.loads(acqd_here("plan", "200", "--measured", "fleet.json", "--json", cwd=tmp_path).stdout)
    value = {one["name"]: one["value"] for one in plain["needs"]}
    double = {one["name"]: one["value"] for one in mine["needs"]}
    assert double["tables"] == pytest.approx(2 * value["tables"])
    assert double["CPU of a PC"] == value["CPU of a PC"]
    assert {one["machine"] for one in mine["used"]} >= {"fleet.json", plain["used"][-1]["machine"]}
    assert mine["demand"]["robots"] == 200


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        (["0"], "N 0: expected"),
        (["200", "--load", "nan"], "--load nan: expected a number from 0.05 to 0.95"),
        (["200", "--load", "1"], "--load 1: expected"),
        (["200", "--rows-per-second", "50"], "--rows-per-second 50: expected a number from 0.001 to 25"),
        (["200", "--quality", "10"], "--quality 10: expected one of off, 10/12, 150/180, 10min"),
        (["200", "--disk", "-1"], "--disk -1: expected"),
        (["200", "--disk", "0.1"], "a year of roll-ups"),
        (["200", "--measured", "none.json"], "none.json: no such file"),
        (["200", "--measured", "other.json"], "holds no figure that a plan uses"),
        (["200", "--measured", "half.json"], "has no figure 'CPU of sinks'"),
        (["200", "--measured", "text.json"], "is no JSON"),
        (["200", "--measured", "object.json"], "expected a list of figures"),
        (["200", "--measured", "zero.json"], "is 0; expected a positive number"),
    ],
)
def test_bad_input_is_one_line(tmp_path, line, complaint):
    half = {"section": "50 devices, x", "name": "stored", "value": 5000.0, "unit": "rows/s"}
    zero = {"section": "spool as segment log, x", "name": "bytes written per row of 300 bytes", "value": 0, "unit": ""}
    for name, content in {
        "other.json": [], "half.json": [half], "zero.json": [zero], "object.json": {"a": 1},
    }.items():  # fmt: skip
        (tmp_path / name).write_text(json.dumps(content))
    (tmp_path / "text.json").write_text("{")
    assert complaint in refused(acqd_here("plan", *line, cwd=tmp_path))
