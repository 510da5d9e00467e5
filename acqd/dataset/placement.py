"""Places many logs in one power stream: a lag for each log, or a refusal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from acqd.dataset.align import SEARCH_S, Lag, coarse_search, overlap, refine
from acqd.dataset.clock_line import ClockLine, deviates, fit_line
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Regressors
from acqd.dataset.supply_lag import USUAL_LAG_S, Regression, common_regression, supply_lag

_WIDER_S = 120.0
_CONTRADICTION = 4.0  # residual of the common regression, over its residual in the other recordings
_MIN_RESIDUAL_W = 0.3
_CLEARLY_BETTER = 0.8  # residual at a log's own lag over the residual at the clock line's lag
_NEIGHBOURS = 5  # recordings before and after
_NO_LAG = Lag(0.0, 0.0, 1.0)
Method = Literal["clock line", "own", "given", "refused"]


@dataclass(frozen=True, slots=True)
class Placement:
    """Place of one log in the power stream."""

    lag_s: float
    """Controller clock minus power clock, at the log's middle."""
    method: Method
    own: Lag
    """The lag that this recording gives without the others."""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Alignment:
    """Placements of all logs of one controller."""

    placements: list[Placement]
    line: ClockLine | None
    supply_lag_s: float


def given(count: int, lag_s: float) -> Alignment:
    """The same lag for all logs, given by the user."""
    return Alignment([Placement(lag_s, "given", _NO_LAG)] * count, None, 0.0)


def place(
    regressors: list[Regressors], power: PowerStream, search_s: float, progress: Callable[[float], None]
) -> Alignment:
    """Places all logs; `search_s` is how far the clocks may differ before the whole stream is searched."""
    lags = own_lags(regressors, power, search_s, progress)
    # one log cannot distinguish the supply's lag from a clock offset
    supply_lag_s, shift = supply_lag(regressors, power, lags) if len(regressors) > 1 else (USUAL_LAG_S, 0.0)
    lags = [replace(lag, seconds=lag.seconds + shift) if lag.credible else lag for lag in lags]
    middles = np.array([_middle(single) for single in regressors])
    line = fit_line(middles, lags)
    placements = [_decide(lag, float(middle), line) for lag, middle in zip(lags, middles, strict=True)]
    doubtful = [
        k for k, placement in enumerate(placements) if placement.method != "refused" and not _confirmed(placement)
    ]
    common = common_regression(regressors, power, lags) if doubtful else None
    if common is None:
        return Alignment(placements, line, supply_lag_s)
    for k in doubtful:
        placement = _back_on_line(regressors[k], power, placements[k], float(middles[k]), line, common)
        placements[k] = _contradicted(regressors[k], power, placement, common) or placement
    return Alignment(placements, line, supply_lag_s)


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
    for centre, half in [*near, (0.0, search_s), (0.0, search_s + _WIDER_S), whole_stream]:
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


def _decide(lag: Lag, middle_s: float, line: ClockLine | None) -> Placement:
    if line is not None and not (lag.credible and deviates(line, middle_s, lag)):
        note = "" if lag.credible else "no credible lag of its own; placed by the clock line of the other recordings"
        return Placement(float(line.at(middle_s)), "clock line", lag, note)
    if not lag.credible:
        reason = f"R2 {lag.r2:.2f}, stands out {lag.ratio:.2f} times"
        return Placement(lag.seconds, "refused", lag, f"no lag explains the power ({reason})")
    if line is None:
        return Placement(lag.seconds, "own", lag)
    off_ms = 1000 * (lag.seconds - float(line.at(middle_s)))
    if abs(off_ms) > 1000 * SEARCH_S:
        reason = f"its best lag is {off_ms / 1000:+.0f} s off the clock line of the other recordings"
        return Placement(lag.seconds, "refused", lag, f"{reason}: is it another robot's, or of another day?")
    return Placement(lag.seconds, "own", lag, f"{off_ms:+.0f} ms off the clock line of the others: was it set?")


def _confirmed(placement: Placement) -> bool:
    """Whether the recording and the clock line agree."""
    return placement.own.credible and placement.method == "clock line"


def _back_on_line(
    regressors: Regressors,
    power: PowerStream,
    placement: Placement,
    middle_s: float,
    line: ClockLine | None,
    common: Regression,
) -> Placement:
    """The clock line's placement, unless the common regression leaves clearly less at the recording's own lag.

    A single recording has some lag at which its many regressors follow, say, a ripple that no regressor explains.
    """
    if line is None or placement.method != "own":
        return placement
    overlapping = overlap(regressors, power, USUAL_LAG_S, replace(placement.own, seconds=placement.lag_s))
    line_lag_s = float(line.at(middle_s))
    if overlapping is None:
        return placement
    own_W, line_W = (common.rest(*overlapping.shifted(lag_s)) for lag_s in (placement.lag_s, line_lag_s))
    if own_W < _CLEARLY_BETTER * line_W:
        return placement
    note = "its own lag is no better; placed by the clock line of the other recordings"
    return Placement(line_lag_s, "clock line", placement.own, note)


def _contradicted(
    regressors: Regressors, power: PowerStream, placement: Placement, common: Regression
) -> Placement | None:
    """A refusal if the power at that place contradicts the regression of the other logs."""
    overlapping = overlap(regressors, power, USUAL_LAG_S, replace(placement.own, seconds=placement.lag_s))
    if overlapping is None:
        return None  # little power there: the merged rows say how little
    rest_W = common.rest(*overlapping.shifted(placement.lag_s))
    if rest_W > _CONTRADICTION * max(common.rest_W, _MIN_RESIDUAL_W):
        reason = f"{rest_W:.1f} W of its power are unexplained, in the other logs {common.rest_W:.1f} W"
        note = f"{reason}: is it another robot's, or was the meter stuck?"
        return Placement(placement.lag_s, "refused", placement.own, note)
    return None


def _middle(regressors: Regressors) -> float:
    return regressors.start_s + len(regressors.columns) * STEP_S / 2
