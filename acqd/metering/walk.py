"""Mean f of the two cycles of a window whatever f does within them, from the phases of its one-cycle phasors.

The mean of f between two instants is what the phase turns by between them. A phasor over one whole cycle, in which
harmonics cancel, knows the mean of the phase over that cycle. From seven of them the best linear estimate of the turn
is Wiener's, for an f that does a random walk beside white noise (N. Wiener, Extrapolation, Interpolation, and Smoothing
of Stationary Time Series, 1949; here as generalised ridge regression with a step of f at `_STEPS` instants). A fast
walk follows a step of f, at two to three times the noise of the fit over two cycles: in whole up to half a cycle before
the end of the window, by half a quarter of a cycle before.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats

_STEPS = 29
"""Instants in the stretch at which f may step."""
_WALK = 100.0
"""Standard deviation of the turn by a walk through the stretch, in those of a phasor's phase by noise. From a third of
that to three times as much, steps are told from noise as well (`tools.studies.frequency`)."""
_FLOOR = 1e-6
"""Of the noise that neighbouring phasors do not share."""


def mean_weights(edges: Floats, start: float, stop: float, rate: float) -> Floats:
    """[phasors]: phases of phasors [rad] against a trial f, times this, are Hz of the mean f above that trial.

    The mean is that over start .. stop; these and `edges` [2, phasors] are positions in samples at `rate` [1/s].
    """
    begin, end = edges
    span, middle = end[-1] - begin[0], (end[-1] + begin[0]) / 2
    steps = begin[0] + span * (np.arange(_STEPS) + 1) / (_STEPS + 1)
    seen = np.column_stack((
        np.ones_like(begin), ((begin + end) / 2 - middle) / span,
        (_ramps(end, steps) - _ramps(begin, steps)) / (end - begin)[:, None] / span,
    ))  # fmt: skip
    asked = _turn(stop, steps, middle, span) - _turn(start, steps, middle, span)
    overlap = np.maximum(0.0, 1 - np.abs(end[:, None] - end) / (end - begin)) + _FLOOR * np.eye(len(begin))
    weighted = np.linalg.solve(overlap, seen)
    walks = np.diag([0.0, 0.0] + [(_STEPS + 1) / _WALK**2] * _STEPS)
    weights = weighted @ np.linalg.solve(seen.T @ weighted + walks, asked)
    return np.asarray(weights * rate / (2 * np.pi * (stop - start)))


def _ramps(at: Floats, steps: Floats) -> Floats:
    """[at, steps] integrals of the turns that steps of f make."""
    return np.asarray(np.maximum(at[:, None] - steps, 0.0) ** 2 / 2)


def _turn(at: float, steps: Floats, middle: float, span: float) -> Floats:
    """Columns at one instant."""
    return np.concatenate(([1.0, (at - middle) / span], np.maximum(at - steps, 0.0) / span))
