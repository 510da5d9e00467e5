"""Thresholds: documented, listed in the report, and nowhere else."""

import ast
from dataclasses import FrozenInstanceError, fields
from pathlib import Path
from typing import get_args

import pytest

import acqd.discrepancy
from acqd.discrepancy.thresholds import THRESHOLDS, Stage, Thresholds, described, table
from acqd.discrepancy.thresholds.__main__ import QUANTITIES

ROOM = Path(acqd.discrepancy.__file__).parent


def test_a_threshold_says_unit_meaning_and_source():
    for each in fields(Thresholds):
        assert {"unit", "meaning", "source", "stage"} <= set(each.metadata), each.name
        assert each.metadata["stage"] in get_args(Stage)
        assert each.metadata["source"] in ("convention", "choice", "study", "physics")


def test_the_report_lists_the_stages_that_ran():
    every = described(set(get_args(Stage)))
    assert [each["name"] for each in every] == [each.name for each in fields(Thresholds)]
    monitor = described({"monitor"})
    assert {"cusum_slack", "cusum_clip"} <= {each["name"] for each in monitor} < {each["name"] for each in every}
    with pytest.raises(FrozenInstanceError):
        THRESHOLDS.chance = 0.5


def test_the_page_of_the_method_has_the_quantities_in_use():
    page = (ROOM.parents[1] / "docs" / "closing-the-loop.md").read_text()
    assert f"<!-- quantities -->\n{table(QUANTITIES)}\n<!-- /quantities -->" in page


def test_every_threshold_is_used():
    text = "\n".join(path.read_text() for path in ROOM.rglob("*.py") if path.parent.name != "thresholds")
    unused = [each.name for each in fields(Thresholds) if f"THRESHOLDS.{each.name}" not in text]
    assert not unused


@pytest.mark.parametrize("path", sorted((ROOM / "selection").rglob("*.py")), ids=lambda path: path.name)
def test_a_comparison_that_selects_has_no_number_of_its_own(path):
    """0, 1, 2 and tiny numbers against division by zero are arithmetic; anything else is a threshold."""
    numbers = [
        (node.lineno, side.value)
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Compare)
        for side in node.comparators
        if isinstance(side, ast.Constant) and isinstance(side.value, int | float) and side.value not in (0, 1, 2, 1e-9)
    ]
    assert not numbers
