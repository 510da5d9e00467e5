"""What the closing report needs to know of a robot, and effects as the loop finds them, without a search."""

from types import SimpleNamespace

import numpy as np

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.repair.terms import Reported
from acqd.discrepancy.selection.accepted import Hypothesis
from acqd.discrepancy.selection.ranking import Finding
from acqd.models.augmented import Term
from tests.builders import ROBOT, recording


def subject_with(model, **more):
    """The part of a subject that the tile reads."""
    recordings = [recording(model, k, rows=300) for k in range(2)]
    return SimpleNamespace(
        **{"carrier": model, "robot": ROBOT, "fit": recordings, "held_out": recordings, "withheld": frozenset()} | more
    )


def found(identity, parameters, shape=None, where="each joint", unit="Nm", evidence=1e3):
    """An effect with a name, with parameters as (value, half width)."""
    values = {
        name: {"value": value, "unit": unit, "ci95": [value - half, value + half]}
        for name, (value, half) in parameters.items()
    }
    term = Term(identity, where, shape or {}, (0,), np.zeros(1), values)
    candidate = Candidate(identity, where, np.zeros(1, dtype=int))
    leader = Hypothesis(Finding(candidate, np.ones(1), np.ones(1), evidence), 15.0, np.inf, 5.0, 1.0, "leads")
    return Reported(
        term, leader, confidence=0.98, alternatives=(), start=None, consistency=1.0, recordings=6,
        family_confidence=0.98,
    )  # fmt: skip
