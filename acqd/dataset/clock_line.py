"""The clock of one controller: the lags of its recordings lie on a line of offset and drift, with steps.

The line averages the errors of single recordings, and it shows which recordings contradict the others. A drift and
every step must pay for itself: drifts of clocks are within some 30 ppm, and clocks are seldom set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.align import Lag
from acqd.numerics import BIWEIGHT_END, biweight, biweight_loss, mad_sigma, theil_sen_slope

_MIN_RECORDINGS = 4
_LEAST_INLIERS = 0.6  # share of the recordings
_DRIFT_PPM = 30.0  # standard deviation of the drift before any log is seen
_STEP_COST = 2 * np.log(100.0)  # -2 log of the chance that a clock is set between two recordings
_LEAST_SCATTER_S = 0.0015
_LEAST_DEVIATION_S = 0.01
_NARROWING = (64.0, 16.0, 4.0, 1.0, 1.0, 1.0)  # scales of the biweight: first all recordings count


@dataclass(frozen=True, slots=True)
class ClockStep:
    """The controller's clock was set."""

    time_s: float
    """Controller time from which the new setting holds: the middle of the first recording after it."""
    seconds: float
    """New minus old lag."""
    after: int
    """Index of the last recording before it."""
    before: int
    """Index of the first recording after it."""


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Lag of a controller's clock over its own time."""

    reference_s: float
    """Controller time at which the offset holds."""
    offset_s: float
    """Before the first step."""
    drift_ppm: float
    scatter_s: float
    """Standard deviation of the recordings around the line."""
    steps: tuple[ClockStep, ...] = ()
    offset_error_s: float = 0.0
    """Standard error of the least certain part between two steps."""
    drift_error_ppm: float = 0.0

    def at(self, time_s: Floats | float) -> Floats | float:
        """Lag [s] at controller time."""
        stepped = sum((step.seconds * (np.asarray(time_s) >= step.time_s) for step in self.steps), np.zeros(()))
        lag = self.offset_s + self.drift_ppm * 1e-6 * (time_s - self.reference_s) + stepped
        return float(lag) if np.ndim(lag) == 0 else np.asarray(lag)

    def error_s(self, time_s: float) -> float:
        """Standard error [s] at controller time."""
        return float(np.hypot(self.offset_error_s, self.drift_error_ppm * 1e-6 * (time_s - self.reference_s)))


@dataclass(frozen=True, slots=True)
class _Data:
    t: Floats
    """[n] s, rising, from the median recording."""
    lags: Floats
    errors: Floats


@dataclass(frozen=True, slots=True)
class _Model:
    values: Floats
    """Lag of each part at t = 0, then the drift in s/s."""
    covariance: Floats
    cost: float
    """-2 log evidence, without what is the same for all models."""
    residual: Floats


def fit_line(times_s: Floats, lags: list[Lag]) -> ClockLine | None:
    """The line through the credible lags at controller times; None when they are too few or on no common line."""
    chosen = np.array([k for k, lag in enumerate(lags) if lag.credible], dtype=np.int64)
    if len(chosen) < _MIN_RECORDINGS:
        return None
    chosen = chosen[np.argsort(times_s[chosen], kind="stable")]
    reference = float(np.median(times_s[chosen]))
    data = _data(times_s[chosen] - reference, [lags[k] for k in chosen])
    breaks, model = _with_steps(data)
    inliers = np.abs(model.residual) <= BIWEIGHT_END * data.errors
    if inliers.mean() < _LEAST_INLIERS:
        return None  # there are two clocks
    steps = tuple(
        ClockStep(float(times_s[chosen[at]]), float(model.values[k + 1] - model.values[k]),
                  int(chosen[at - 1]), int(chosen[at]))
        for k, at in enumerate(breaks)
    )  # fmt: skip
    scatter = float(model.residual[inliers].std())
    error = np.sqrt(np.diag(model.covariance))
    offset, drift = float(model.values[0]), float(model.values[-1]) * 1e6
    return ClockLine(reference, offset, drift, scatter, steps, float(error[:-1].max()), float(error[-1]) * 1e6)


def deviates(line: ClockLine, time_s: float, lag: Lag) -> bool:
    """Whether a recording's own lag contradicts the line."""
    limit = max(_LEAST_DEVIATION_S, 4 * lag.error_s, 5 * line.scatter_s)
    return abs(lag.seconds - float(line.at(time_s))) > limit


def _data(t: Floats, lags: list[Lag]) -> _Data:
    """Times and lags with errors of at least what neighbours in time differ by."""
    values = np.array([lag.seconds for lag in lags])
    slope = theil_sen_slope(t, values, least_apart=float(np.ptp(t)) / 10)
    differences = np.diff(values - slope * t)
    scatter = max(mad_sigma(differences) / np.sqrt(2), _LEAST_SCATTER_S)
    stated = np.array([lag.error_s for lag in lags])
    return _Data(t, values, np.maximum(stated, min(scatter, 2 * float(np.median(stated)) + _LEAST_SCATTER_S)))


def _with_steps(data: _Data) -> tuple[list[int], _Model]:
    """The best model: steps are added one by one, each where it lowers the cost most, until none pays for itself."""
    count = len(data.t)
    price = _STEP_COST + np.log(count)
    breaks: list[int] = []
    best = _fitted(data, breaks)
    while len(breaks) < count // _MIN_RECORDINGS:
        tried = [sorted([*breaks, at]) for at in range(1, count) if at not in breaks]
        models = [_fitted(data, each) for each in tried]
        at = int(np.argmin([model.cost for model in models]))
        if models[at].cost + price >= best.cost:
            break
        breaks, best = tried[at], models[at]
    return breaks, best


def _fitted(data: _Data, breaks: list[int]) -> _Model:
    """The model with steps before the recordings `breaks`, without drift unless the evidence is larger with it."""
    return min((_robust(data, breaks, drift_ppm) for drift_ppm in (0.0, _DRIFT_PPM)), key=lambda model: model.cost)


def _robust(data: _Data, breaks: list[int], drift_ppm: float) -> _Model:
    """Biweight regression; `drift_ppm` is the standard deviation of the drift's normal prior, 0: no drift."""
    part = np.searchsorted(breaks, np.arange(len(data.t)), side="right")
    parts = len(breaks) + 1
    X = np.column_stack([part[:, None] == np.arange(parts), data.t]).astype(np.float64)
    prior = np.zeros(parts + 1)
    prior[-1] = (1e6 / drift_ppm) ** 2 if drift_ppm else 1e30
    values = np.array([*(np.median(data.lags[part == k]) for k in range(parts)), 0.0])
    for scale in _NARROWING:
        trust = biweight(data.lags - X @ values, scale * data.errors) / data.errors**2
        weighted = X * trust[:, None]
        information = weighted.T @ X + np.diag(prior + 1e-6)
        values = np.asarray(np.linalg.solve(information, weighted.T @ data.lags))
    if not drift_ppm:
        values[-1] = 0.0  # but for rounding
    residual = data.lags - X @ values
    covariance: Floats = np.asarray(np.linalg.inv(information))
    cost = biweight_loss(residual, data.errors)
    if drift_ppm:  # the Occam factor: how much the recordings narrow the prior
        cost += prior[-1] * values[-1] ** 2 - float(np.log(prior[-1] * covariance[-1, -1]))
    return _Model(values, covariance, cost, np.asarray(residual))
