"""Masking the rows of transient effects: what remains there may be the error of their shape.

A peak of 300 W when the brakes open is never fitted to the last watt, and its remainder outweighs hours of a payload.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.selection.ranking import Finding
from acqd.discrepancy.thresholds import THRESHOLDS

_BEFORE = 2  # rows masked before an event


def transient(design: Design, finding: Finding, gate: Floats) -> bool:
    """Whether an effect acts in few rows only: when brakes open, when the tool switches."""
    acting = _acting(design, finding)
    if acting is None:
        return False
    own = [acting[part.segment][part.own] for part, open_ in zip(design.parts, gate, strict=True) if open_]
    return bool(np.concatenate(own).mean() < THRESHOLDS.event_share)


def without_rows_of(design: Design, findings: list[Finding]) -> Design:
    """The design without the rows of some effects, and without the rows into which whitening carries them."""
    order = THRESHOLDS.noise_order
    trusted = [rows.copy() for rows in design.trusted]
    reach = np.ones(2 * order + 1, dtype=bool)
    reach[: order - _BEFORE] = False
    for finding in findings:
        acting = _acting(design, finding)
        if acting is None:
            continue
        for number, part in enumerate(design.parts):
            # rows before the block count too: the first white rows depend on them
            touched = binary_dilation(acting[part.segment], reach)[part.own]
            trusted[number] &= ~touched
    return design.with_trusted(tuple(trusted))


def _acting(design: Design, finding: Finding) -> list[NDArray[np.bool_]] | None:
    """[T] per segment; None for an effect without power."""
    candidate = finding.candidate
    weights = candidate.weights(finding.coefficients)
    size = [np.abs(design.values(k, candidate.places) @ weights) for k in range(len(design.columns.segments))]
    most = max((float(power.max()) for power in size if len(power)), default=0.0)
    return [power > THRESHOLDS.event_power * most for power in size] if most > 0 else None
