"""Places many logs in one power stream: a lag for each log with its uncertainty, or a refusal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.align import SEARCH_S, Lag
from acqd.dataset.announcements import ANNOUNCED_S, step_notes, supply_notes
from acqd.dataset.clock_line import ClockLine, deviates, fit_line
from acqd.dataset.left_out import Judge, Judgement
from acqd.dataset.own_lags import own_lags
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Regressors
from acqd.dataset.split import sources_of
from acqd.dataset.supply_lag import SupplyLag, supply_lag
from acqd.numerics import NORMAL_95

_CONTRADICTION = 4.0  # residual under the regression of the others, over its usual residual
_MIN_RESIDUAL_W = 0.3
_CLEARLY_BETTER = 0.8  # residual at a log's own lag over the residual at the clock line's lag
_MODEL_ERROR_S = 0.002  # that all recordings of a robot share: the regression is not the robot
_NO_LAG = Lag(0.0, 0.0, 1.0)
Method = Literal["clock line", "own", "given", "refused"]


@dataclass(frozen=True, slots=True)
class Placement:
    """Place of one log in the power stream."""

    lag_s: float
    """Controller clock minus power clock, at the log's middle."""
    method: Method
    own: Lag
    """The lag of this recording without the clock line."""
    note: str = ""
    within_s: float | None = None
    """Half the width of the 95 % interval of the lag; None: the user gave the lag."""


@dataclass(frozen=True, slots=True)
class Alignment:
    """Placements of all logs of one controller."""

    placements: list[Placement]
    line: ClockLine | None
    supply_lag_s: float
    supply_within_s: float | None = None
    """Half the width of the 95 % interval of the supply's lag."""
    notes: list[str] = field(default_factory=list)
    """What the user should know about the clock."""


def given(count: int, lag_s: float) -> Alignment:
    """The same lag for all logs, given by the user."""
    return Alignment([Placement(lag_s, "given", _NO_LAG)] * count, None, 0.0)


def place(
    regressors: list[Regressors],
    power: PowerStream,
    search_s: float,
    progress: Callable[[float], None],
    names: list[str] | None = None,
) -> Alignment:
    """Places all logs; `search_s` is how far the clocks may differ before the whole stream is searched.

    `names` are the logs' names, by which logs of the same programme are known.
    """
    names = names or [f"log {k + 1}" for k in range(len(regressors))]
    lags = own_lags(regressors, power, search_s, lambda share: progress(0.4 * share))
    supply = supply_lag(regressors, power, lags, lambda share: progress(0.4 + 0.4 * share))
    lags = [replace(lag, seconds=lag.seconds + supply.shift_s) if lag.credible else lag for lag in lags]
    middles = np.array([single.start_s + len(single.columns) * STEP_S / 2 for single in regressors])
    placer = _Placer(middles, supply, names, [single.age_error_s + power.stamp_error_s for single in regressors])
    if supply.fit is None:
        return placer.placed(lags, None, [None] * len(lags))
    sources = sources_of(names)
    judge = Judge(regressors, power, supply, [sources[name] for name in names])
    judgements = _judgements(judge, lags, middles, lambda share: progress(0.8 + 0.2 * share))
    judged = [_replaced(lag, judgement) for lag, judgement in zip(lags, judgements, strict=True)]
    return placer.placed(judged, judge, judgements)


def _judgements(
    judge: Judge, lags: list[Lag], middles: Floats, progress: Callable[[float], None]
) -> list[Judgement | None]:
    """The lag of every recording by the regression of the others.

    It is searched near the recording's own lag. A recording without one, or one that contradicts the clock line, is
    searched near the line as well; the place where less is left unexplained wins.
    """
    found: list[Judgement | None] = []
    for k, lag in enumerate(lags):
        found.append(judge.lag(k, lag.seconds) if lag.credible else None)
        progress(0.5 * (k + 1) / len(lags))
    line = fit_line(middles, [_replaced(lag, judgement) for lag, judgement in zip(lags, found, strict=True)])
    if line is None:
        return found
    for k, (lag, judgement) in enumerate(zip(lags, found, strict=True)):
        at_s = float(line.at(middles[k]))
        if judgement is None or not judgement.credible or deviates(line, middles[k], _replaced(lag, judgement)):
            near_line = judge.lag(k, at_s)
            if near_line is not None and (judgement is None or near_line.rest_W < judgement.rest_W):
                found[k] = near_line
        progress(0.5 + 0.5 * (k + 1) / len(lags))
    return found


def _replaced(lag: Lag, judgement: Judgement | None) -> Lag:
    """The lag that the regression of the others gives, if it explains the recording."""
    if judgement is None or not judgement.credible:
        return lag
    # one weight for the whole motion can hardly fit noise: a large share of the power is enough to trust the lag
    ratio = max(lag.ratio, 1 / max(1 - judgement.r2, 1e-3))
    return Lag(judgement.lag_s, max(lag.r2, judgement.r2), ratio, judgement.error_s)


@dataclass(frozen=True, slots=True)
class _Placer:
    """Decides for each log."""

    middles: Floats
    supply: SupplyLag
    names: list[str]
    stamps_s: list[float]
    """By how much the stamps of each log or of the power may be wrong, all alike."""

    def placed(self, lags: list[Lag], judge: Judge | None, judgements: list[Judgement | None]) -> Alignment:
        """The placements by clock line or own lags."""
        doubted = self._doubted(lags)
        line = fit_line(self.middles, doubted)
        placements = [
            replace(_decide(judged, float(middle), line), own=lag)
            for judged, lag, middle in zip(doubted, lags, self.middles, strict=True)
        ]
        if judge is not None:
            for k, placement in enumerate(placements):
                if placement.method == "own" and line is not None:
                    placement = _back_on_line(judge, k, placement, float(line.at(self.middles[k])))
                if placement.method != "refused":
                    placement = _contradicted(judge, k, placement, judgements[k])
                placements[k] = placement
        placements = [self._with_interval(k, placement, line) for k, placement in enumerate(placements)]
        within_s = NORMAL_95 * self.supply.error_s
        notes = step_notes(line, self.names) + supply_notes([p.within_s or 0.0 for p in placements], self.supply)
        return Alignment(placements, line, self.supply.seconds, within_s, notes)

    def _doubted(self, lags: list[Lag]) -> list[Lag]:
        """Lags with errors that say which logs have worse stamps than the others, by which they may leave the line."""
        least_s = min(self.stamps_s, default=0.0)
        beyond = [(stamp_s - least_s) / np.sqrt(3) for stamp_s in self.stamps_s]  # as if each were equally likely
        return [
            replace(lag, error_s=float(np.hypot(lag.error_s, more_s))) for lag, more_s in zip(lags, beyond, strict=True)
        ]

    def _with_interval(self, k: int, placement: Placement, line: ClockLine | None) -> Placement:
        """The placement with its uncertainty, which is announced here if the recording itself causes it."""
        if placement.method == "refused":
            return placement
        on_line = line is not None and placement.method == "clock line"
        own_s = line.error_s(float(self.middles[k])) if line is not None and on_line else placement.own.error_s
        alone_s = NORMAL_95 * float(np.hypot(own_s, _MODEL_ERROR_S))
        within_s = float(np.hypot(alone_s, NORMAL_95 * self.supply.shared_error_s)) + self.stamps_s[k]
        note = placement.note
        if alone_s > ANNOUNCED_S:
            uncertain = f"its lag is uncertain by {1000 * within_s:.0f} ms (95 %)"
            note = f"{note}; {uncertain}" if note else uncertain
        return replace(placement, within_s=within_s, note=note)


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


def _back_on_line(judge: Judge, k: int, placement: Placement, line_s: float) -> Placement:
    """The clock line's placement, unless the regression of the others leaves clearly less at the own lag."""
    there, own = judge.at(k, line_s), judge.at(k, placement.lag_s)
    if there is None or own is None or own.rest_W < _CLEARLY_BETTER * there.rest_W:
        return placement
    note = "its own lag is no better; placed by the clock line of the other recordings"
    return Placement(line_s, "clock line", placement.own, note)


def _contradicted(judge: Judge, k: int, placement: Placement, judgement: Judgement | None) -> Placement:
    """A refusal if the power at that place contradicts the regression of the other logs; else the placement."""
    there = judge.at(k, placement.lag_s)
    if there is None:
        return placement  # little power there: the merged rows say how little
    usual_W = judge.usual_rest()
    if not there.credible and there.rest_W > _CONTRADICTION * max(usual_W, _MIN_RESIDUAL_W):
        reason = f"{there.rest_W:.1f} W of its power are unexplained, in the other logs {usual_W:.1f} W"
        note = f"{reason}: is it another robot's, or was the meter stuck?"
        return Placement(placement.lag_s, "refused", placement.own, note)
    if placement.method == "own" and (judgement is None or not judgement.credible):
        note = "the regression of the other logs does not explain its power, and no clock line places it"
        return Placement(placement.lag_s, "refused", placement.own, note)
    return placement
