"""Power that the controller measured and wrote into the log itself (`--power log`): no clock but the log's."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.power import PowerStream
from acqd.errors import InputError
from acqd.robot.log import RobotLog, in_time

LEAST_W = 2.0
"""The electronics of the smallest arms at rest take more."""
_HIGH = 95
"""Percentile of the power that a robot in operation exceeds."""
_SAMPLE_ROWS = 100_000
LOG = "log"
"""As `--power`: the power is in the logs."""


def log_power(log: RobotLog) -> PowerStream:
    """The power of one log; each sample is the middle of a window. Raises InputError without usable power.

    Its voltage is the DC bus's, not the mains', so that Vrms is unknown.
    """
    if log.power is None:
        raise InputError(
            log.path,
            "holds no power: expected the column power [W], or bus_voltage [V] and bus_current [A], "
            "or columns that the robot's description names so under [[log]]",
        )
    time, rows = in_time(log)
    P = log.power[rows]
    known = P[np.isfinite(P)]
    if len(known) < 3 or np.ptp(known) == 0.0:
        raise InputError(log.path, "its power is constant or missing")
    window_ns = round(float(np.median(np.diff(time))) * 1e6) * 1000
    time_ns = np.rint(time * 1e9).astype(np.int64) - window_ns // 2
    dropped = len(log.time) - len(time)
    power = PowerStream(time_ns, P, np.full(len(P), np.nan), window_ns, dropped, "bus", str(log.path))
    require_drawn(power)
    return power


def require_drawn(power: PowerStream) -> None:
    """Raises InputError if power flows out of the robot on average."""
    known = some_power(power)
    mean_W = float(known.mean()) if len(known) else 0.0
    if mean_W < 0:
        raise InputError(
            power.origin,
            f"its power is {mean_W:.4g} W on average; expected W that the robot takes: is the sign inverted, or a "
            "current transformer mounted the other way round?",
        )


def small_power(powers: list[PowerStream]) -> list[str]:
    """A note on power that is too small for a robot; a meter may run for hours while the robot is off."""
    known = [some_power(each) for each in powers]
    high = [float(np.percentile(each, _HIGH)) for each in known if len(each)]
    high_W = float(np.median(high or [np.inf]))
    if high_W >= LEAST_W:
        return []
    return [f"the power is below {high_W:.3g} W in {_HIGH} % of the rows, little for a robot: is it in kW? expected W"]


def some_power(power: PowerStream) -> Floats:
    """Known power [n] W of rows at equal distances: a stream may be larger than memory."""
    some = power.P[:: max(1, len(power.P) // _SAMPLE_ROWS)]
    return np.asarray(some[np.isfinite(some)])
