"""Findings that physics forbids, or whose every interval holds zero."""

import pytest

from tests.models.effects.test_few_axes import arm_scene
from tools.studies.measured_robots.bounds import faults


@pytest.fixture(scope="module")
def scene():
    return arm_scene()


def report(value, ci95, identity="payload", where="flange", name="mass"):
    parameters = {name: {"value": value, "unit": "kg", "ci95": ci95}, "centre_of_mass_m": {"value": 0.1, "ci95": None}}
    return {"effects": [{"id": identity, "where": where, "parameters": parameters}]}


@pytest.mark.parametrize(
    ("made", "fault"),
    [
        (report(2.7, [2.3, 3.1]), None),
        (report(0.3, [-0.1, 0.7]), "every interval holds zero"),
        (report(120.0, [110.0, 130.0]), "mass is 120, possible are"),
        (report(117.0, [90.0, 140.0], "supply_efficiency", "supply", "loss at 100 W"), "loss at 100 W is 117"),
    ],
)
def test_impossible_findings_are_faults(scene, made, fault):
    found = [each.text for each in faults(made, scene)]
    assert len(found) == (fault is not None)
    assert fault is None or found[0].startswith(fault)
