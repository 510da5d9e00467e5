"""Whether power and motion that acqd did not align belong together in time: tables, logged power, a lag that was given.

Every recording tells its lag as in an alignment. A supply delays the power; more than the slowest supply does, and any
lead, is an error of the clocks.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acqd.dataset.align import SEARCH_S, Lag, coarse_search, refine
from acqd.dataset.merge import Recording
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import regressors_of
from acqd.dataset.supply_lag import LONGEST_S, UNKNOWN_ERROR_S, USUAL_LAG_S
from acqd.errors import InputError
from acqd.numerics import NORMAL_95, mad_sigma
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog

_JUDGED, _FEWEST = 12, 3
"""Recordings that are judged at most, and that have to agree."""
_MOST_ROWS = 3000
"""Rows of a recording that are judged: two minutes at 40 ms tell a lag."""


def clock_doubts(recordings: list[Recording], robot: RobotDescription, step_s: float) -> list[str]:
    """A line if the power of merged recordings comes before the motion, or later than any supply delays it."""
    some = recordings[:: -(-len(recordings) // _JUDGED)] if recordings else []
    lags = [lag.seconds for each in some if (lag := _lag(each, robot, step_s)) is not None and lag.credible]
    if len(lags) < max(_FEWEST, len(some) / 2):
        return []
    lag_s = float(np.median(lags))
    error_s = float(np.hypot(mad_sigma(np.array(lags), lag_s) / np.sqrt(len(lags)), UNKNOWN_ERROR_S))
    within_s = NORMAL_95 * error_s
    if abs(lag_s) < LONGEST_S + within_s:
        return []
    side = "before" if lag_s > 0 else "after"
    return [
        f"the power comes {1000 * abs(lag_s):.0f} +- {1000 * within_s:.0f} ms {side} the motion that causes it, in "
        f"{len(lags)} of {len(some)} recordings: the clocks differ; shift the power by that, or let acqd dataset build "
        "align logs and power"
    ]


def _lag(recording: Recording, robot: RobotDescription, step_s: float) -> Lag | None:
    """Lag of the motion's clock; None where the motion is too short, or too little."""
    first = max(0, (len(recording.time_ns) - _MOST_ROWS) // 2)
    rows = slice(first, first + _MOST_ROWS)
    valid, time_ns, window_ns = recording.valid[rows], recording.time_ns[rows], round(1e9 * step_s)
    known = valid if recording.context is None else valid | recording.context[rows]
    time = time_ns[known].astype(np.float64) * 1e-9
    log = RobotLog(Path(recording.name), time, recording.of_axes("q", robot.axes)[rows][known])
    P = np.where(valid, recording.columns["P"][rows], np.nan)
    power = PowerStream(time_ns - window_ns // 2, P, np.full(len(P), np.nan), window_ns, 0, "mains", recording.name)
    try:
        regressors = regressors_of(log, robot, "model")
    except InputError:
        return None
    lag = coarse_search(regressors, power, USUAL_LAG_S, 0.0, SEARCH_S)
    return refine(regressors, power, USUAL_LAG_S, lag) if lag is not None and lag.credible else lag
