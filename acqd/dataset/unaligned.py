"""Whether power and motion that acqd did not align belong together in time: tables, logged power, a lag that was given.

Some recordings are aligned after all. A supply delays the power; more than the slowest supply does, and any lead, is an
error of the clocks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.align import SEARCH_S
from acqd.dataset.merge import Recording
from acqd.dataset.own_lags import WIDER_S
from acqd.dataset.placement import place
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import Regressors, regressors_of
from acqd.dataset.supply_lag import LONGEST_S
from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog

_JUDGED, _FEWEST = 8, 3
"""Recordings that are judged at most, and that have to be placed."""
_CONFIRMED = 0.75
"""Share of them: seconds of motion fit some power anywhere."""
_LONGEST_S = 60.0
"""Of a recording that is judged: a minute tells a lag."""
Pair = tuple[RobotLog, PowerStream]
"""Motion, and the power in which its place is looked for."""


def clock_doubts(
    pairs: Sequence[Pair], robot: RobotDescription, remedy: Callable[[float], str], lag_s: float = 0.0
) -> list[str]:
    """A line if the power comes before the motion, or later than any supply delays it.

    `lag_s` is the lag that was given (controller minus power clock); `remedy` says what to do, by the lag that fits.
    """
    fast = [pair for pair in pairs if pair[1].fast]
    some = fast[:: -(-len(fast) // _JUDGED)] if fast else []
    moved = [each for log, power in some if (each := _with_power(log, power, robot, lag_s)) is not None]
    if len(moved) < _FEWEST:
        return []
    placed = [each for each in place(*_on_one_clock(moved), SEARCH_S, lambda _: None).placements if each.within_s]
    if len(placed) < max(_FEWEST, _CONFIRMED * len(some)):
        return []
    beyond_s = float(np.median([each.lag_s for each in placed]))
    within_s = float(np.median([each.within_s or 0.0 for each in placed]))
    if not LONGEST_S + within_s < abs(beyond_s) < WIDER_S:  # farther away lies the power of other recordings
        return []
    side = "before" if beyond_s > 0 else "after"
    return [
        f"the power comes {abs(beyond_s):.2f} +- {within_s:.2f} s {side} the motion that causes it, in {len(placed)} "
        f"of {len(some)} recordings: the clocks differ; {remedy(lag_s + beyond_s)}"
    ]


def log_of(recording: Recording, robot: RobotDescription) -> RobotLog:
    """The rows of a recording whose angles are known, with its currents, torques and signals, as a log."""
    known = recording.valid if recording.context is None else recording.valid | recording.context
    current, tau = (
        recording.of_axes(name, robot.axes)[known]
        if all(f"{name}{axis + 1}" in recording.columns for axis in range(robot.axes))
        else None
        for name in ("current", "tau")
    )
    signals: dict[str, Floats] = {
        name: recording.columns[name][known] for name in ("tool", "brake") if name in recording.columns
    }
    time, q = recording.time_ns[known].astype(np.float64) * 1e-9, recording.of_axes("q", robot.axes)[known]
    return RobotLog(Path(recording.name), time, q, tau=tau, current=current, signals=signals)


def pair_of(recording: Recording, robot: RobotDescription, step_s: float) -> Pair:
    """Motion and power of a recording that is merged already, as a log and a stream."""
    window_ns = round(1e9 * step_s)
    P = np.where(recording.valid, recording.columns["P"], np.nan)
    power = PowerStream(
        recording.time_ns - window_ns // 2, P, np.full(len(P), np.nan), window_ns, 0, "mains", recording.name
    )
    return log_of(recording, robot), power


def _with_power(
    log: RobotLog, power: PowerStream, robot: RobotDescription, lag_s: float
) -> tuple[Regressors, PowerStream] | None:
    """The middle of a log by the power's clock, and the power around it; None where the motion is too short."""
    middle = (log.time.min() + log.time.max()) / 2 if len(log.time) else 0.0
    try:
        found = regressors_of(log.part(np.abs(log.time - middle) < _LONGEST_S / 2, log.path), robot, "model")
    except InputError:
        return None
    found = replace(found, start_s=found.start_s - lag_s)
    rows = power.part(round(1e9 * (found.t[0] - WIDER_S)), round(1e9 * (found.t[-1] + WIDER_S)))
    return found, replace(power, time_ns=power.time_ns[rows], P=power.P[rows], Vrms=power.Vrms[rows])


def _on_one_clock(pairs: list[tuple[Regressors, PowerStream]]) -> tuple[list[Regressors], PowerStream]:
    """All recordings and their power one after the other, so far apart that none is looked for in another's power."""
    moved, end_s = [], 0.0
    for regressors, power in pairs:
        first_s = min(regressors.start_s, float(power.time_ns[0]) * 1e-9 if len(power.time_ns) else np.inf)
        by_s = round(end_s - first_s, 3)
        time_ns = power.time_ns + round(1e9 * by_s)
        moved.append((replace(regressors, start_s=regressors.start_s + by_s), replace(power, time_ns=time_ns)))
        last_s = max(moved[-1][0].t[-1], float(time_ns[-1]) * 1e-9 if len(time_ns) else -np.inf)
        end_s = last_s + 2 * WIDER_S + 2 * SEARCH_S
    parts = [power for _, power in moved]
    joined = replace(
        parts[0], time_ns=np.concatenate([each.time_ns for each in parts]),
        P=np.concatenate([each.P for each in parts]), Vrms=np.concatenate([each.Vrms for each in parts]),
    )  # fmt: skip
    return [regressors for regressors, _ in moved], joined
