"""Findings are told apart although their coefficients are arrays."""

from dataclasses import replace

import numpy as np

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.selection.ranking import Finding


def test_two_shapes_of_one_effect_have_their_own_places_in_a_list():
    cold = Candidate("thermal_friction", "joint 2", np.array([3, 4]))
    warm = replace(cold, places=np.array([5, 6]))
    findings = [Finding(candidate, np.array([1.0, 2.0]), 3.0, 2.0) for candidate in (cold, warm)]
    assert findings.index(findings[1]) == 1
    assert findings[0] != replace(findings[0])
