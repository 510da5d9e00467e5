"""The lag that each log gives without the others: coarse search near its neighbours' lags, then refinement."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acqd.dataset.align import SEARCH_S, Lag, coarse_search, refine
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Regressors
from acqd.dataset.supply_lag import USUAL_LAG_S

WIDER_S = 120.0
"""Farther away than the range of a search: where a lag is looked for next."""
_NEIGHBOURS = 5  # recordings before and after
_NO_LAG = Lag(0.0, 0.0, 1.0)


def own_lags(
    regressors: list[Regressors], power: PowerStream, search_s: float, progress: Callable[[float], None]
) -> list[Lag]:
    """The lag that each log gives without a clock line, refined where it is credible."""
    by_time = sorted(range(len(regressors)), key=lambda k: regressors[k].start_s)
    coarse: dict[int, Lag] = {}
    for number, k in enumerate(by_time):
        earlier = [coarse[j].seconds for j in by_time[:number] if coarse[j].credible]
        coarse[k] = _coarse(regressors[k], power, earlier, search_s)
        progress(0.5 * (number + 1) / len(regressors))
    _search_near_neighbours(regressors, power, coarse, by_time)
    lags = [coarse[k] for k in range(len(regressors))]
    for number, (single, lag) in enumerate(zip(regressors, lags, strict=True)):
        if lag.credible:
            lags[number] = refine(single, power, USUAL_LAG_S, lag)
        progress(0.5 + 0.5 * (number + 1) / len(regressors))
    return lags


def _coarse(regressors: Regressors, power: PowerStream, earlier: list[float], search_s: float) -> Lag:
    """Searches near the lags of earlier recordings, then within the range, then further, then the whole stream."""
    stream = (power.time_ns[0] * 1e-9, power.time_ns[-1] * 1e-9)
    start, end = regressors.start_s, regressors.start_s + len(regressors.columns) * STEP_S
    whole_stream = (start + end) / 2 - sum(stream) / 2, (stream[1] - stream[0] + end - start) / 2
    best = _NO_LAG
    # the last few only: clocks drift
    near = [(float(np.median(earlier[-_NEIGHBOURS:])), SEARCH_S)] if earlier else []
    for centre, half in [*near, (0.0, search_s), (0.0, search_s + WIDER_S), whole_stream]:
        lag = coarse_search(regressors, power, 0.0, centre, half)
        if lag is not None and lag.r2 > best.r2:
            best = lag
        if best.credible:
            break
    return best


def _search_near_neighbours(
    regressors: list[Regressors], power: PowerStream, coarse: dict[int, Lag], by_time: list[int]
) -> None:
    """Searches again, near its neighbours in time, for a lag that is far from theirs or not credible."""
    for number, k in enumerate(by_time):
        neighbours = by_time[max(0, number - _NEIGHBOURS) : number + _NEIGHBOURS + 1]
        around = [coarse[j].seconds for j in neighbours if j != k and coarse[j].credible]
        if len(around) < 3:
            continue
        centre = float(np.median(around))
        if abs(coarse[k].seconds - centre) > SEARCH_S or not coarse[k].credible:
            lag = coarse_search(regressors[k], power, 0.0, centre, SEARCH_S)
            if lag is not None and (lag.credible or not coarse[k].credible):
                coarse[k] = lag
