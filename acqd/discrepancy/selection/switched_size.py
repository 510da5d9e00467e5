"""The size of a load that switches: from its levels, not from its steps.

In white noise, steps weigh far more than levels. Some detected steps are wrong by a fraction of a second, where
another error of the model hides the true one, and each of those pulls the size towards zero. A wrong second changes
the mean level of minutes by little.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Regression
from acqd.discrepancy.selection.accepted import Selected
from acqd.discrepancy.selection.detectors.candidates import residuals_of
from acqd.discrepancy.thresholds import THRESHOLDS


def switches(selected: Selected) -> bool:
    """Whether the residual showed when the effect is on."""
    return selected.finding.candidate.detected and "share_of_time" in selected.shape


def sizes_by_levels(design: Design, regression: Regression, selected: Selected) -> Floats:
    """[1 + n] size from all recordings, and without every recording in turn (every block, if recordings are few).

    Ordinary least squares of the residual in W on the effect's column, both about their means in every block.
    `regression`: with all selected effects.
    """
    residuals = residuals_of(design, regression, omit=selected.key)
    open_ = [part for part, own in zip(design.parts, selected.gate.open, strict=True) if own]
    names = [part.recording for part in open_]
    if len(set(names)) < THRESHOLDS.few_recordings:
        names = [str(number) for number in range(len(open_))]
    sums = {name: np.zeros(2) for name in names}
    for name, part in zip(names, open_, strict=True):
        column = design.values(part.segment, selected.finding.candidate.indices, part.own)[:, 0]
        residual = residuals[part.segment][part.own]
        column = column - column.mean()
        sums[name] += column @ (residual - residual.mean()), column @ column
    each = np.array(list(sums.values()))
    left = np.vstack([each.sum(axis=0), each.sum(axis=0) - each])
    return np.asarray(left[:, 0] / np.maximum(left[:, 1], 1e-9))
