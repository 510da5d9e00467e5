"""Intervals of the parameters of a selected effect (jackknife over recordings)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acqd import student
from acqd.arrays import Floats
from acqd.discrepancy.selection.accepted import Selected, Selection
from acqd.discrepancy.selection.placing import without
from acqd.discrepancy.selection.shape_interval import Fit, Neighbours, fit_at
from acqd.discrepancy.selection.switched_size import sizes_by_levels, switches
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library


@dataclass(frozen=True, slots=True)
class Intervals:
    """Coefficients [k] and the value of a fitted shape, with half widths of their 95 % intervals."""

    coefficients: Floats
    half: Floats
    shape: float | None = None
    shape_half: float | None = None
    """None: no shape was fitted, or too few recordings; infinite: the recordings do not determine the shape."""
    left_out: tuple[Fit, ...] = ()
    """Without one recording each, where these determine the interval."""

    def half_of(self, function: Callable[[Fit], float]) -> float | None:
        """Half the width of the 95 % interval of a function of size and shape, which err together; None: unknown."""
        if not self.left_out:
            return None
        spread = _jackknife([np.array([function(each)]) for each in self.left_out])
        return float(student.ppf(0.975, len(self.left_out) - 1) * spread[0])


def intervals(selection: Selection, selected: Selected) -> Intervals:
    """Given all other selected effects.

    Delete-one-recording jackknife (Tukey 1958) beside the usual scatter, and at least the width for white noise. A
    fitted shape is fitted again without every recording, so that its uncertainty is in the size too.
    """
    blocks_in_question = int((selected.gate.open > 0).sum())
    if switches(selected) and blocks_in_question > 1:  # one block says nothing about the spread
        by_levels = sizes_by_levels(selection.design, selection.regression, selected)
        spread = _jackknife([np.array([size]) for size in by_levels[1:]])
        return Intervals(by_levels[:1], float(student.ppf(0.975, len(by_levels) - 2)) * spread)
    rows = without(selection.rows, selected)
    design, regression = rows.design, rows.regression
    neighbours = Neighbours.of(design, regression, selected)

    def fit(weights: Floats) -> Fit:
        if neighbours is not None:
            return neighbours.fit(weights)
        return fit_at(design, regression, selected.finding.candidate, selected.gate.open, weights)

    whole = fit(np.ones(len(design.parts)))
    sizes = fit_at(design, regression, selected.finding.candidate, selected.gate.open, np.ones(len(design.parts)))
    names = sorted({part.recording for part, open_ in zip(design.parts, selected.gate.open, strict=True) if open_})
    left = [
        fit(np.array([float(not part.in_question or part.recording != name) for part in design.parts]))
        for name in names
    ]
    noise = THRESHOLDS.interval_width * np.sqrt(whole.variance)
    if len(left) < THRESHOLDS.few_recordings:
        return Intervals(sizes.coefficients, noise, whole.shape)
    usual = np.hypot(
        np.sqrt(whole.variance / selection.rows.learning_rate), THRESHOLDS.column_deviation * sizes.coefficients
    )
    half = np.hypot(half_beside(usual, _jackknife([each.coefficients for each in left]), len(left)), noise)
    if whole.shape is None:
        return Intervals(sizes.coefficients, half, left_out=tuple(left))
    of_shape = float(student.ppf(0.975, len(left) - 1)) * float(
        _jackknife([np.array([each.shape]) for each in left])[0]
    )
    shape_half = float(np.hypot(of_shape, _of_columns(whole, selected)))
    return Intervals(sizes.coefficients, half, whole.shape, shape_half, tuple(left))


def half_beside(usual: Floats, scatter: Floats, recordings: int) -> Floats:
    """[k] half widths of 95 % intervals from standard errors [k]: the usual ones, and those that few recordings show.

    The scatter of three recordings is uncertain itself: by chance it is three times too large, or next to nothing. It
    counts beside the usual one as the variances of few sessions do, and Student's factor has the degrees of freedom of
    both (Smyth 2004).
    """
    weight, freedom = THRESHOLDS.few_sessions, recordings - 1
    spread = np.sqrt((weight * usual**2 + freedom * scatter**2) / (weight + freedom))
    return np.asarray(float(student.ppf(0.975, weight + freedom)) * spread)


def _of_columns(whole: Fit, selected: Selected) -> float:
    """Half the width of the 95 % interval of a fitted shape in white noise, and as far as the columns are wrong.

    Columns that are wrong by a share s of their power leave s^2 of the evidence to another shape. Of the size, the same
    makes a share s.
    """
    deviation = np.hypot(THRESHOLDS.column_deviation, library()[selected.id].simplified(selected.place))
    wrong = whole.shape_variance * (1.0 + deviation**2 * whole.drop)
    return float(THRESHOLDS.interval_width * np.sqrt(wrong))


def _jackknife(left: list[Floats]) -> Floats:
    """[k] standard errors from estimates [k] without one recording each."""
    deviations = np.array(left) - np.mean(left, axis=0)
    return np.asarray(np.sqrt((len(left) - 1) / len(left) * (deviations**2).sum(axis=0)))
