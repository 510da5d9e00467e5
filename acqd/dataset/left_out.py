"""Judges each recording by the regression of the others: its lag, the lag's error, and whether it fits at all.

Recordings of the same programme are left out together: a regression that has met a motion explains it too well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from acqd.arrays import Floats
from acqd.dataset.align import Lag, Overlap, overlap
from acqd.dataset.common_fit import autocorrelation, scale_of, without_slow
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import Regressors
from acqd.dataset.supply_lag import SupplyLag
from acqd.numerics import biweight, biweight_loss

_REACH_S = 0.2
"""How far around a given lag the lag is searched."""
_GRID_S = 0.02  # a quarter of the shortest period below BAND_HZ is 100 ms
_STEPS = 6
_LEAST_ROWS_PER_WEIGHT = 4
_MIN_R2 = 0.2
_LEAST_W = 1e-3


@dataclass(frozen=True, slots=True)
class Judgement:
    """A recording at the lag at which the regression of the others explains most."""

    lag_s: float
    error_s: float
    """Standard error for autocorrelated residuals, without what all recordings have in common."""
    r2: float
    """Share of the power's variance that the others' regression explains; robust, without slow changes."""
    rest_W: float
    """RMS of what it does not explain."""

    @property
    def credible(self) -> bool:
        """Whether the others' regression explains this recording."""
        return self.r2 >= _MIN_R2


class Judge:
    """The regression of all recordings, from which any can be left out."""

    def __init__(self, regressors: list[Regressors], power: PowerStream, supply: SupplyLag, sources: list[str]) -> None:
        """`sources` names the programme of every recording; `supply` must have a fit."""
        assert supply.fit is not None
        self._regressors, self._power, self._supply, self._fit = regressors, power, supply, supply.fit
        self._sources = sources
        self._known: dict[str, Floats] = {}
        self._rests: dict[int, float] = {}

    def usual_rest(self) -> float:
        """W: median over the recordings of the regression of the RMS that the others' regression leaves of each."""
        return float(np.median([self._rests[k] for k in self._supply.chosen if k in self._rests] or [0.0]))

    def lag(self, k: int, near_s: float) -> Judgement | None:
        """Recording `k` at its best lag within 0.2 s of `near_s`; None if too little power is there."""
        predicted = self._predicted(k, near_s)
        if predicted is None:
            return None
        tried = near_s + np.arange(-_REACH_S, _REACH_S + _GRID_S / 2, _GRID_S)
        usual_W = max(float(np.median(np.abs(predicted.y))), _LEAST_W)
        lag_s = float(tried[int(np.argmin([biweight_loss(predicted.residual(lag)[0], usual_W) for lag in tried]))])
        for _ in range(_STEPS):
            residual, slope = predicted.residual(lag_s)
            trust = biweight(residual, scale_of([residual]))
            lag_s += float(trust @ (slope * residual)) / max(float(trust @ slope**2), 1e-9)
            lag_s = float(np.clip(lag_s, near_s - _REACH_S, near_s + _REACH_S))
        judgement = self._judged(predicted, lag_s)
        self._rests[k] = judgement.rest_W
        return judgement

    def at(self, k: int, lag_s: float) -> Judgement | None:
        """Recording `k` at a given lag; None if too little power is there."""
        predicted = self._predicted(k, lag_s)
        return None if predicted is None else self._judged(predicted, lag_s)

    def _predicted(self, k: int, near_s: float) -> _Predicted | None:
        """Recording `k` with the power that the others' regression predicts; None if too little power is there.

        Supply, meter and band limit are linear, so that they act on the prediction instead of on all regressors.
        """
        single, weights, near = self._regressors[k], self._weights(k), Lag(near_s, 0.0, 1.0)
        power = single.columns[:, : len(weights)] @ weights
        found = overlap(
            replace(single, columns=power[:, None]), self._power, self._supply.seconds, near, self._supply.average_s
        )
        enough = found is not None and len(found.at) >= 2 * single.columns.shape[1]
        return _Predicted(found) if found is not None and enough else None

    def _weights(self, k: int) -> Floats:
        """Weights without the recordings of the same programme, or all weights if too few others remain."""
        source = self._sources[k]
        if source not in self._known:
            twins = [at for at, other in enumerate(self._supply.chosen) if self._sources[other] == source]
            others = [share.gram for at, share in enumerate(self._fit.shares) if at not in twins]
            rows = len(self._fit.residual) * len(others) / len(self._fit.shares)
            enough = rows >= _LEAST_ROWS_PER_WEIGHT * len(self._fit.weights)
            self._known[source] = self._fit.weights_without(twins) if enough else self._fit.weights
        return self._known[source]

    def _judged(self, predicted: _Predicted, lag_s: float) -> Judgement:
        residual, slope = predicted.residual(lag_s)
        scale_W = max(scale_of([residual]), self._fit.scale_W)
        # a periodic motion repeats its error: where residual and slope swing alike, the product stays positive
        together = autocorrelation([residual], whole=True) * autocorrelation([slope], whole=True)
        inflation = max(1.0, 1 + 2 * float(together[1:].sum()))
        strength = max(float(slope @ slope), 1e-9)
        error_s = min(scale_W * float(np.sqrt(inflation / strength)), _REACH_S)
        total = float(np.median(np.abs(predicted.y - np.median(predicted.y))) ** 2)
        left = float(np.median(np.abs(residual)) ** 2)
        return Judgement(lag_s, error_s, 1 - left / max(total, 1e-12), float(residual.std()))


class _Predicted:
    """Metered and predicted power of one recording, without slow changes."""

    def __init__(self, found: Overlap) -> None:
        """`found` has one column, the predicted power."""
        self._at, self._t = found.at, found.t
        self._step_s = float(np.median(np.diff(found.at)))
        power = found.columns[:, 0]
        self._power, self._slope = CubicSpline(found.t, power), CubicSpline(found.t, power).derivative()
        self.y = without_slow(found.P, self._step_s)

    def residual(self, lag_s: float) -> tuple[Floats, Floats]:
        """Metered minus predicted power [N] W at a lag, and the prediction's change with the lag [N] W/s."""
        at = np.clip(self._at + lag_s, self._t[0], self._t[-1])
        return self.y - without_slow(self._power(at), self._step_s), without_slow(self._slope(at), self._step_s)
