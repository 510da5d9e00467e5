"""The rows that a found effect leaves alone: what acts there cannot be the error of its shape.

A peak of 300 W when the brakes open is never fitted to the last watt; what it leaves over outweighs hours of a payload.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from acqd.discrepancy.regression.design_matrix import Design, sum_up
from acqd.discrepancy.residual.whitening import ORDER
from acqd.discrepancy.selection.ranking import Finding

_ACTS = 0.01  # of its largest power
_MOST = 0.15  # of the rows: more than that is no event
_BEFORE = 2  # rows


def confined(design: Design, finding: Finding, gate: NDArray[np.float64]) -> bool:
    """Whether an effect acts at moments only: when brakes open, when the tool switches."""
    acting = _acting(design, finding)
    if acting is None:
        return False
    own = [acting[part.segment][part.rows] for part, open_ in zip(design.parts, gate, strict=True) if open_]
    return bool(np.concatenate(own).mean() < _MOST)


def elsewhere(design: Design, findings: list[Finding]) -> Design:
    """The same design without the rows of these effects, and those into which whitening carries them."""
    trusted = [rows.copy() for rows in design.trusted]
    reach = np.ones(2 * ORDER + 1, dtype=bool)
    reach[: ORDER - _BEFORE] = False
    for finding in findings:
        acting = _acting(design, finding)
        if acting is None:
            continue
        for number, part in enumerate(design.parts):
            # rows before the part count too: its first white rows remember them
            touched = binary_dilation(acting[part.segment], reach)[part.rows][ORDER:]
            trusted[number] &= ~touched
    other = replace(design, trusted=trusted)
    sum_up(other)
    return other


def _acting(design: Design, finding: Finding) -> list[NDArray[np.bool_]] | None:
    """Per stretch [T]; None for an effect without power of its own."""
    candidate, theta = finding.candidate, finding.coefficients
    weights = theta if candidate.mix is None else candidate.mix @ theta
    size = [np.abs(raw[:, candidate.places] @ weights) for raw in design.raw]
    most = max((float(each.max()) for each in size if len(each)), default=0.0)
    return [each > _ACTS * most for each in size] if most > 0 else None
