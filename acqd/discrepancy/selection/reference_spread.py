"""The spread of an effect over unchanged sessions of the reference: what is not more has not changed.

Rows and blocks of a session share its errors: the meter's gain and the standby power drift over many minutes, and the
base model is wrong in other ways in another motion. Then its blocks agree, and surprise, without an effect.
The model is that of a random-effects meta-analysis (DerSimonian and Laird 1986), every session a study.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from acqd.arrays import Floats
from acqd.dataset.split import log_of
from acqd.discrepancy.regression.design_columns import Part
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Regression
from acqd.discrepancy.selection.ranking import Finding
from acqd.discrepancy.thresholds import THRESHOLDS


def knows_spread(design: Design) -> bool:
    """Whether the reference has enough sessions to know what unchanged ones differ by."""
    return len(_sessions(design.parts)) >= THRESHOLDS.fewest_for_noise


def beyond_reference_spread(design: Design, regression: Regression, finding: Finding) -> bool:
    """Whether the finding is larger than what two unchanged sessions differ by.

    True with too few sessions to know. The recordings in question count as one session, since nobody knows how far
    apart two sessions must be to be independent.
    """
    amplitudes, information = amplitudes_in_reference(design, regression, finding)
    if len(amplitudes) < THRESHOLDS.fewest_for_noise:
        return True
    limit = float(student.isf(THRESHOLDS.spread_chance / 2, len(amplitudes) - 1))
    return bool(limit * np.sqrt(2.0) * between_sessions(amplitudes, information) < 1.0)


def amplitudes_in_reference(design: Design, regression: Regression, finding: Finding) -> tuple[Floats, Floats]:
    """[sessions] the finding's size in single sessions of the reference, in units of itself, and their information.

    By generalised least squares in one session, with a base model that knows the reference only. The information is
    the inverse variance of an amplitude in white noise.
    """
    candidate, coefficients = finding.candidate, finding.coefficients
    unchanged = 1 - design.columns.in_question
    pairs = []
    for blocks in _sessions(design.parts).values():
        gate = np.zeros(len(design.parts))
        gate[blocks] = 1.0
        competition = regression.compete(candidate.places, gate, unchanged)
        weights = candidate.weights(coefficients)
        known = float(weights @ competition.schur @ weights)
        if known > THRESHOLDS.least_column_power:
            pairs.append((float(weights @ competition.products) / known, known))
    values = np.array(pairs).reshape(-1, 2)
    return values[:, 0], values[:, 1]


def between_sessions(amplitudes: Floats, information: Floats) -> float:
    """Standard deviation between sessions about zero, beyond white noise (method of moments)."""
    excess = float(information @ amplitudes**2) - len(amplitudes)
    return float(np.sqrt(max(excess, 0.0) / information.sum()))


def _sessions(parts: tuple[Part, ...]) -> dict[str, NDArray[np.int64]]:
    """Blocks of the reference by log."""
    sessions: dict[str, list[int]] = {}
    for number, part in enumerate(parts):
        if not part.in_question:
            sessions.setdefault(log_of(part.recording), []).append(number)
    return {name: np.array(blocks) for name, blocks in sessions.items()}
