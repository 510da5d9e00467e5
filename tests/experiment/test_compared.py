"""What is believed of the causes that the next recording has to decide between."""

import numpy as np
import pytest

from acqd.discrepancy.causes.belief import NOTHING, OUTSIDE, Belief
from acqd.experiment.compared import beliefs, share_compared

LABELS = ["viscous_friction", "thermal_friction", OUTSIDE, OUTSIDE]
EVIDENCE = np.array([129.0, 126.0, 123.0, 120.0])


def test_causes_are_believed_as_the_report_says():
    said = Belief({"viscous_friction": 0.93, "thermal_friction": 0.04, OUTSIDE: 0.02}, ("viscous_friction",))
    shares = beliefs(LABELS, EVIDENCE, 3.0, said)
    assert shares.sum() == pytest.approx(1.0)
    assert shares[0] / shares[1] == pytest.approx(0.93 / 0.04)
    assert shares[2:].sum() / shares[1] == pytest.approx(0.5) and shares[2] / shares[3] == pytest.approx(np.e)


def test_a_cause_that_the_report_does_not_list_has_no_more_than_the_least_likely_one_that_it_does():
    shares = beliefs(LABELS[:2], EVIDENCE[:2], 3.0, Belief({"viscous_friction": 0.9, "nothing": 0.1}, ()))
    assert shares == pytest.approx([0.9, 0.1])


@pytest.mark.parametrize("said", [None, Belief({"payload": 0.9, "nothing": 0.1}, ("payload",))])
def test_without_the_report_their_evidence_decides(said):
    shares = beliefs(LABELS[:2], EVIDENCE[:2], 3.0, said)
    assert shares[0] / shares[1] == pytest.approx(np.e)


def test_what_is_believed_of_other_causes_counts_as_not_named_and_nothing_does_not_count():
    believed = Belief({"payload": 0.4, "mounting": 0.2, NOTHING: 0.2, "copper_loss": 0.2}, ("payload",))
    assert share_compared(["payload", "mounting"], believed) == pytest.approx(0.75)
    assert share_compared(["payload", "payload"], None) == 1.0
    assert share_compared(["payload", "mounting", "copper_loss"], believed) == pytest.approx(1.0)
