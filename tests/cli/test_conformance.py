"""`acqd conformance` as a user types it."""

from __future__ import annotations

import json

from tests.commands import acqd_here


def test_the_sheet_as_json_and_as_a_page(tmp_path):
    box = tmp_path / "box.toml"
    box.write_text('name = "test box"\n[uncertainty]\ngain_percent = 0.01\n')
    page = tmp_path / "sheet.html"
    done = acqd_here(
        "conformance", "--only", "unbalance", "--terminal", box, "--jobs", 1, "--out", page, "--json"
    )  # fmt: skip
    sheet = json.loads(done.stdout)
    assert done.returncode == 0 and sheet["passed"] and not sheet["complete"] and sheet["failed"] == []
    assert len(sheet["points"]) == 6 and all(point["passed"] for point in sheet["points"])
    assert sheet["terminal"]["name"] == "test box" and sheet["budgets"][0]["passed"]
    text = page.read_text()
    assert "By simulation, converter and transformers not included unless described" in text
    assert "http" not in text.partition("<main>")[2].replace("http://www.w3.org", "")


def test_a_point_that_fails_is_named_and_ends_with_1(tmp_path):
    box = tmp_path / "box.toml"
    box.write_text("bits = 8\nrange_v = 100000.0\n")
    done = acqd_here("conformance", "--only", "unbalance", "--terminal", box, "--jobs", 1)
    assert done.returncode == 1 and "FAILED: IEC 62586-2 / IEC 61000-4-30, class A: unbalance" in done.stdout


def test_bad_input_is_one_line(tmp_path):
    for words, said in (
        (("--only", "colour"), "--only colour: unknown; expected one of frequency"),
        (("--out", tmp_path / "sheet.pdf"), "a report ends in .html"),
        (("--out", tmp_path / "none" / "sheet.html"), "does not exist; create it"),
        (("--terminal", tmp_path / "none.toml"), "no such file"),
    ):
        done = acqd_here("conformance", *words)
        assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1
