"""Thresholds: documented, listed in the report, and nowhere else."""

import ast
from dataclasses import FrozenInstanceError, fields
from pathlib import Path
from typing import get_args

import pytest

import acqd.discrepancy
from acqd.discrepancy.thresholds import OF_THE_LOOP, THRESHOLDS
from acqd.discrepancy.thresholds.__main__ import quantities
from acqd.monitor.thresholds import MONITOR
from acqd.residual.thresholds import NOISE
from acqd.threshold import Stage, described

ROOM = Path(acqd.discrepancy.__file__).parent


BUDGET = 44
"""Thresholds of the loop: a new one takes the place of another (ADR 26)."""
GROUPS = (*OF_THE_LOOP, MONITOR)


def test_a_threshold_says_unit_meaning_and_source():
    for each in [each for group in GROUPS for each in fields(group)]:
        assert {"unit", "meaning", "source", "stage"} <= set(each.metadata), each.name
        assert each.metadata["stage"] in get_args(Stage)
        assert each.metadata["source"] in ("convention", "choice", "study", "physics")


def test_the_loop_keeps_to_its_budget():
    assert len(described(OF_THE_LOOP, get_args(Stage))) <= BUDGET


def test_the_report_lists_the_stages_that_ran():
    names = [each.name for group in OF_THE_LOOP for each in fields(group)]
    assert [each["name"] for each in described(OF_THE_LOOP, get_args(Stage))] == names
    delays = described(OF_THE_LOOP, {"delay"})
    assert {"delay_reach_s", "delay_floor_s"} <= {each["name"] for each in delays} < set(names)
    with pytest.raises(FrozenInstanceError):
        THRESHOLDS.chance = 0.5


def test_the_page_of_the_method_has_the_quantities_in_use():
    page = (ROOM.parents[1] / "docs" / "closing-the-loop.md").read_text()
    assert f"<!-- quantities -->\n{quantities()}\n<!-- /quantities -->" in page


def test_every_threshold_is_used():
    text = "\n".join(path.read_text() for path in ROOM.parent.rglob("*.py"))
    for owner, group in (("THRESHOLDS", THRESHOLDS), ("NOISE", NOISE), ("MONITOR", MONITOR)):
        assert not [each.name for each in fields(group) if f"{owner}.{each.name}" not in text]


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
