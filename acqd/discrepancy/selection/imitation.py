"""What an error of effects that were named earlier imitates: a later effect must be more than that.

The description's masses, torques and frictions are wrong by some percent, and so are the columns of every effect.
What the columns of a large effect get wrong looks like small other effects.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.selection.accepted import Named
from acqd.discrepancy.selection.ranking import Finding
from acqd.discrepancy.thresholds import THRESHOLDS


def beyond_earlier(design: Design, earlier: Sequence[Named], finding: Finding) -> bool:
    """Whether the power is larger than what an error of the earlier effects can imitate.

    Where the earlier effects draw p, a relative error e of their columns leaves e p. Columns of a later effect that
    acts only while p has one sign, with the power c, imitate the share e sum(c p) / sum(c^2) of themselves.
    """
    if not earlier:
        return True
    mine = _power_in_question(design, finding)
    theirs = sum(_power_in_question(design, named.finding) for named in earlier)
    return bool(mine @ mine > THRESHOLDS.earlier_error * abs(mine @ theirs))


def _power_in_question(design: Design, finding: Finding) -> Floats:
    """[rows] W of a finding in the recordings in question."""
    weights = finding.candidate.weights(finding.coefficients)
    segments = sorted({part.segment for part in design.parts if part.in_question})
    return np.concatenate([design.values(k, finding.candidate.places) @ weights for k in segments])
