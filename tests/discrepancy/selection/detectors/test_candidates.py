"""Candidates that detectors derive from the residual."""

import numpy as np
import pytest

from acqd.discrepancy.selection.detectors.candidates import detect, residuals_of
from tests.discrepancy.independent import thermostat, traced
from tests.models.effects.test_effects import DESIGN_IDS


@pytest.mark.slow
def test_derived_candidates_leave_the_residual_of_known_levels(model, robot):
    _, selection = traced(model, robot, thermostat, count=14, rows=700, only={"thermostat", "process_load"})
    left = np.concatenate(
        [each for k, each in enumerate(residuals_of(selection.design, selection.regression)) if k >= 14]
    )
    assert left.std() < 1.2
    again = detect(selection.design, selection.regression, selection.design.columns.in_question, set(DESIGN_IDS))
    assert not any(each.effect for each in again)
