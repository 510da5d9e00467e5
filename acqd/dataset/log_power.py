"""Power that the controller measured and wrote into the log itself (`--power log`): no clock but the log's."""

from __future__ import annotations

import numpy as np

from acqd.dataset.power import PowerStream
from acqd.errors import InputError
from acqd.robot.log import RobotLog, in_time

_LEAST_W = 2.0
"""The electronics of the smallest arms at rest take more."""
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
    mean_W = float(known.mean())
    if mean_W < 0:
        raise InputError(
            log.path, f"its power is {mean_W:.4g} W on average; expected W that the robot takes: is the sign inverted?"
        )
    window_ns = round(float(np.median(np.diff(time))) * 1e6) * 1000
    time_ns = np.rint(time * 1e9).astype(np.int64) - window_ns // 2
    return PowerStream(time_ns, P, np.full(len(P), np.nan), window_ns, len(log.time) - len(time), "bus", str(log.path))


def small_power(powers: list[PowerStream]) -> list[str]:
    """A note on power that is too small for a robot."""
    usual_W = float(np.median([np.nanmean(each.P) for each in powers]))
    if usual_W >= _LEAST_W:
        return []
    return [f"the logs' power is {usual_W:.3g} W on average, little for a robot: is it in kW? expected W"]
