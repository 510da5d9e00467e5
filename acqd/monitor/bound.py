"""The bound of a CUSUM chart for a mean time between false alarms, from the values of an unchanged robot.

If r solves E exp(r (z - k)) = 1, independent values exceed h by chance once in about exp(r h) values (Lundberg's
exponent; Wald 1947). Correlated values count as fewer: the bound is multiplied by (1 + rho) / (1 - rho), the long-run
variance of an AR(1) process with the measured autocorrelation rho.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from acqd.arrays import Floats
from acqd.monitor.thresholds import MONITOR


def bound(z: Floats, count: float) -> float:
    """Height that a CUSUM of values `z` [n], in the order of time, exceeds by chance once in `count` values."""

    def moment(r: float) -> float:
        return float(np.mean(np.exp(r * (z - MONITOR.cusum_slack)))) - 1.0

    centred = z - z.mean()
    rho = float(centred[1:] @ centred[:-1]) / max(float(centred @ centred), 1e-12) + 1 / np.sqrt(len(z))  # cautious
    rho = float(np.clip(rho, 0.0, 0.9))
    slower = (1 + rho) / (1 - rho)
    if z.max() <= MONITOR.cusum_slack:
        return slower * float(np.log(count))
    high = 1.0
    while moment(high) < 0 and high < 64:
        high *= 2
    low = high
    while moment(low) >= 0 and low > 1e-3:
        low /= 2
    rate = float(brentq(moment, low, high)) if moment(low) < 0 <= moment(high) else low
    return slower * float(np.log(count)) / max(rate, 0.05)
