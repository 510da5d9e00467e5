"""From many logs and one power stream to a lag for every log, or a refusal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from acqd.dataset.align import SEARCH_S, Lag, coarse_search, overlap, refine
from acqd.dataset.clock_line import ClockLine, deviates, fit_line
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Explanation
from acqd.dataset.supply_lag import USUAL_LAG_S, Regression, common_regression, supply_lag

_FURTHER_S = 120.0
_TIMES_WORSE = 4.0  # unexplained power that contradicts
_LEAST_REST_W = 0.3
_CLEARLY = 0.8  # of the power left unexplained, for a recording to stand against the others' clock
_NONE = Lag(0.0, 0.0, 1.0)
Method = Literal["clock line", "own", "given", "refused"]


@dataclass(frozen=True, slots=True)
class Located:
    """One log's place in the power stream."""

    lag_s: float
    """Controller clock minus power clock, at the log's middle."""
    method: Method
    own: Lag
    """What this recording alone says."""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Alignment:
    """All logs of one controller."""

    located: list[Located]
    line: ClockLine | None
    supply_lag_s: float


def locate(
    explained: list[Explanation], power: PowerStream, search_s: float, progress: Callable[[float], None]
) -> Alignment:
    """Lags of all logs; `search_s` is how far the clocks may be apart before the whole stream is searched."""
    in_time = sorted(range(len(explained)), key=lambda k: explained[k].start_s)
    found: dict[int, Lag] = {}
    for number, k in enumerate(in_time):
        before = [found[j].seconds for j in in_time[:number] if found[j].credible]
        found[k] = _coarse(explained[k], power, before, search_s)
        progress(0.5 * (number + 1) / len(explained))
    _second_look(explained, power, found, in_time)
    lags = [found[k] for k in range(len(explained))]
    for number, (about, lag) in enumerate(zip(explained, lags, strict=True)):
        if lag.credible:
            lags[number] = refine(about, power, USUAL_LAG_S, lag)
        progress(0.5 + 0.5 * (number + 1) / len(explained))
    # one log alone cannot tell the supply's lag from its clock's
    supply_lag_s, shift = supply_lag(explained, power, lags) if len(explained) > 1 else (USUAL_LAG_S, 0.0)
    lags = [replace(lag, seconds=lag.seconds + shift) if lag.credible else lag for lag in lags]
    middles = np.array([_middle(about) for about in explained])
    line = fit_line(middles, lags)
    located = [_decide(lag, float(middle), line) for lag, middle in zip(lags, middles, strict=True)]
    doubtful = [k for k, place in enumerate(located) if place.method != "refused" and not _backed(place)]
    common = common_regression(explained, power, lags) if doubtful else None
    if common is None:
        return Alignment(located, line, supply_lag_s)
    for k in doubtful:
        located[k] = _kept_by_others(explained[k], power, located[k], float(middles[k]), line, common)
        located[k] = _contradicted(explained[k], power, located[k], common) or located[k]
    return Alignment(located, line, supply_lag_s)


def _backed(place: Located) -> bool:
    """Whether the recording itself and the others say the same."""
    return place.own.credible and place.method == "clock line"


def _kept_by_others(
    about: Explanation, power: PowerStream, place: Located, middle_s: float, line: ClockLine | None, common: Regression
) -> Located:
    """Back on the clock line, unless its own place is clearly better by what motion takes in all other logs.

    One recording alone finds some lag at which its many quantities follow a ripple, say, that no quantity explains.
    """
    if line is None or place.method != "own":
        return place
    both = overlap(about, power, USUAL_LAG_S, replace(place.own, seconds=place.lag_s))
    at_line_s = float(line.at(middle_s))
    if both is None or common.rest(*both.shifted(place.lag_s)) < _CLEARLY * common.rest(*both.shifted(at_line_s)):
        return place
    return Located(at_line_s, "clock line", place.own, "its own lag is no better; placed by the others' clock")


def _contradicted(about: Explanation, power: PowerStream, place: Located, common: Regression | None) -> Located | None:
    """A refusal, when the power at that place is not what the motion takes in all other logs."""
    both = overlap(about, power, USUAL_LAG_S, replace(place.own, seconds=place.lag_s))
    if both is None or common is None:
        return None  # little power there: merging tells how little
    rest_W = common.rest(*both.shifted(place.lag_s))
    if rest_W > _TIMES_WORSE * max(common.rest_W, _LEAST_REST_W):
        reason = f"{rest_W:.1f} W of its power stay unexplained, {common.rest_W:.1f} W of the others'"
        return Located(place.lag_s, "refused", place.own, f"{reason}: is it another robot's, or was the meter stuck?")
    return None


def given(count: int, lag_s: float) -> Alignment:
    """One clock, or a lag that the user knows."""
    return Alignment([Located(lag_s, "given", _NONE)] * count, None, 0.0)


def _coarse(about: Explanation, power: PowerStream, before: list[float], search_s: float) -> Lag:
    """Near the recordings just before, then within the search range, then further, then anywhere in the stream."""
    stream = (power.time_ns[0] * 1e-9, power.time_ns[-1] * 1e-9)
    begin, end = about.start_s, about.start_s + len(about.columns) * STEP_S
    anywhere = (begin + end) / 2 - sum(stream) / 2, (stream[1] - stream[0] + end - begin) / 2
    best = _NONE
    near = [(float(np.median(before[-5:])), SEARCH_S)] if before else []  # clocks drift apart: not all of them
    for centre, half in [*near, (0.0, search_s), (0.0, search_s + _FURTHER_S), anywhere]:
        found = coarse_search(about, power, 0.0, centre, half)
        if found is not None and found.r2 > best.r2:
            best = found
        if best.credible:
            break
    return best


def _second_look(explained: list[Explanation], power: PowerStream, found: dict[int, Lag], in_time: list[int]) -> None:
    """What lies far from its neighbours in time, or stood out nowhere, is looked for again near them."""
    for place, k in enumerate(in_time):
        around = [j for j in in_time[max(0, place - 5) : place + 6] if j != k and found[j].credible]
        if len(around) < 3:
            continue
        centre = float(np.median([found[j].seconds for j in around]))
        if abs(found[k].seconds - centre) > SEARCH_S or not found[k].credible:
            again = coarse_search(explained[k], power, 0.0, centre, SEARCH_S)
            if again is not None and (again.credible or not found[k].credible):
                found[k] = again


def _decide(lag: Lag, middle_s: float, line: ClockLine | None) -> Located:
    if line is not None and not (lag.credible and deviates(line, middle_s, lag)):
        note = "" if lag.credible else "not credible alone; placed by the other recordings' clock"
        return Located(float(line.at(middle_s)), "clock line", lag, note)
    if not lag.credible:
        reason = f"R2 {lag.r2:.2f}, stands out {lag.ratio:.2f} times"
        return Located(lag.seconds, "refused", lag, f"no lag explains the power ({reason})")
    if line is None:
        return Located(lag.seconds, "own", lag)
    off_ms = 1000 * (lag.seconds - float(line.at(middle_s)))
    if abs(off_ms) > 1000 * SEARCH_S:
        reason = f"explains power {off_ms / 1000:+.0f} s off the clock of the others best"
        return Located(lag.seconds, "refused", lag, f"{reason}: is it another robot's, or of another day?")
    return Located(lag.seconds, "own", lag, f"{off_ms:+.0f} ms off the clock of the others: was it set?")


def _middle(about: Explanation) -> float:
    return about.start_s + len(about.columns) * STEP_S / 2
