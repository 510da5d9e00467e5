"""What `acqd close-loop --explain ID` says of an effect."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.report.way import way_of
from acqd.discrepancy.selection.accepted import Hypothesis
from acqd.discrepancy.selection.ranking import Finding


def row(name, evidence, status, missing=()):
    candidate = Candidate(name, "joint 1", np.zeros(1, dtype=int), key=name)
    finding = Finding(candidate, np.ones(1), np.ones(1), evidence)
    return Hypothesis(finding, 15.0, np.inf, 5.0, 0.1, status, missing)


def way(*table):
    selection = SimpleNamespace(tables=[table])
    return way_of(SimpleNamespace(selection=selection, improved=SimpleNamespace(effects=())), "viscous_friction")


@pytest.mark.parametrize(
    ("evidence", "said"),
    [
        (390.0, "; leads, 10 ahead of thermal_friction"),
        (
            403.0,
            "; leads; thermal_friction has 3 more evidence, and lacks more evidence than wrong columns of "
            "viscous_friction leave",
        ),
    ],
)
def test_the_leader_is_said_to_be_ahead_or_what_a_larger_one_lacks(evidence, said):
    leader = row("viscous_friction", 400.0, "leads")
    lacks = "more evidence than wrong columns of viscous_friction leave" if evidence > 400 else "10 more evidence"
    other = row("thermal_friction", evidence, "candidate", (lacks,))
    (line,) = way(*sorted([leader, other], key=lambda each: -each.finding.evidence))
    assert line.endswith(said)
    assert way(leader)[0].endswith("; leads")


def test_what_does_not_lead_says_what_is_missing():
    refused = row("viscous_friction", 10.0, "refused", ("evidence above 15",))
    (line,) = way(row("payload", 400.0, "leads"), refused)
    assert line.endswith("; missing: evidence above 15")
    assert way(replace(refused, missing=()))[0].endswith("W matter")
    assert way(row("payload", 400.0, "leads"))[0] == "step 1: not among the 1 leading hypotheses"
    assert way()[0] == "viscous_friction: no evidence in any step"
