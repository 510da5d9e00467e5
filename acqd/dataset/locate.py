"""From many logs and one power stream to a lag for every log, or a refusal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from acqd.dataset.align import SEARCH_S, Lag, coarse_search, refine
from acqd.dataset.clocks import ClockLine, deviates, fit_line
from acqd.dataset.explain import STEP_S, Explanation
from acqd.dataset.power import PowerStream

_SUPPLY_LAGS_S = (0.0, 0.006, 0.012, 0.018, 0.024, 0.036, 0.05)
_PROBED = 12  # recordings that the supply's lag is found from
_NONE = Lag(0.0, 0.0, 1.0)
Method = Literal["clock line", "own", "refused"]


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
    lags: list[Lag] = []
    for number, about in enumerate(explained):
        lags.append(_coarse(about, power, lags, search_s))
        progress(0.5 * (number + 1) / len(explained))
    lags = _second_look(explained, power, lags)
    supply_lag_s = _supply_lag(explained, power, lags)
    for number, (about, lag) in enumerate(zip(explained, lags, strict=True)):
        if lag.credible:
            lags[number] = refine(about, power, supply_lag_s, lag)
        progress(0.5 + 0.5 * (number + 1) / len(explained))
    middles = np.array([_middle(about) for about in explained])
    line = fit_line(middles, lags)
    return Alignment([_decide(lag, float(t), line) for lag, t in zip(lags, middles, strict=True)], line, supply_lag_s)


def _coarse(about: Explanation, power: PowerStream, before: list[Lag], search_s: float) -> Lag:
    """Near the others first, then within the search range, then anywhere in the stream."""
    known = [lag.seconds for lag in before if lag.credible]
    stream = (power.time_ns[0] * 1e-9, power.time_ns[-1] * 1e-9)
    begin, end = about.start_s, about.start_s + len(about.columns) * STEP_S
    anywhere = (begin + end) / 2 - sum(stream) / 2, (stream[1] - stream[0] + end - begin) / 2
    best = _NONE
    for centre, half in [*([(float(np.median(known)), SEARCH_S)] if known else []), (0.0, search_s), anywhere]:
        found = coarse_search(about, power, 0.0, centre, half)
        if found is not None and found.r2 > best.r2:
            best = found
        if best.credible:
            break
    return best


def _second_look(explained: list[Explanation], power: PowerStream, lags: list[Lag]) -> list[Lag]:
    """What lies far from all others, or stood out nowhere, is looked for again near the others."""
    known = np.array([lag.seconds for lag in lags if lag.credible])
    if len(known) < 3:
        return lags
    centre = float(np.median(known))
    looked = []
    for about, lag in zip(explained, lags, strict=True):
        if abs(lag.seconds - centre) > SEARCH_S or not lag.credible:
            again = coarse_search(about, power, 0.0, centre, SEARCH_S)
            if again is not None and (again.credible or not lag.credible):
                lag = again
        looked.append(lag)
    return looked


def _supply_lag(explained: list[Explanation], power: PowerStream, lags: list[Lag]) -> float:
    """The first-order lag of the mains side that explains most of the power; it would pass for clock offset else."""
    chosen = [k for k, lag in enumerate(lags) if lag.credible]
    chosen = chosen[:: max(1, len(chosen) // _PROBED)]
    if not chosen:
        return 0.0

    def left_over(candidate: float) -> float:
        shares = [1 - refine(explained[k], power, candidate, lags[k]).r2 for k in chosen]
        return float(np.mean(np.log(np.array(shares) + 1e-9)))

    unexplained = np.array([left_over(candidate) for candidate in _SUPPLY_LAGS_S])
    best = int(unexplained.argmin())
    if best in (0, len(_SUPPLY_LAGS_S) - 1):
        return _SUPPLY_LAGS_S[best]
    around = slice(best - 1, best + 2)
    a, b, _ = np.polyfit(_SUPPLY_LAGS_S[around], unexplained[around], 2)
    low, high = _SUPPLY_LAGS_S[best - 1], _SUPPLY_LAGS_S[best + 1]
    return min(max(float(-b / (2 * a)), low), high) if a > 0 else _SUPPLY_LAGS_S[best]


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
    return Located(lag.seconds, "own", lag, f"{off_ms:+.0f} ms off the clock of the others: was it set?")


def _middle(about: Explanation) -> float:
    return about.start_s + len(about.columns) * STEP_S / 2
