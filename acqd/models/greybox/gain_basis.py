"""Parameters as the power shows them: times the gain from joint power to mains power.

Without logged torques, only products are known: all torques may be larger by a factor, if the gain, the copper losses
and the conduction losses are smaller by that factor, its square and itself. Each fit picks a gain near the
description's. Robots are therefore compared by their torques at one common gain, and by their gains apart.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.greybox.parameters import Layout

_POWERS = {"inertial": 1.0, "rotor": 1.0, "coulomb": 1.0, "viscous": 1.0, "copper": -2.0, "conduction": -1.0}


def powers(layout: Layout) -> Floats:
    """[p] k: a parameter x is compared as x (gain / common gain)^k."""
    values = np.zeros(layout.size)
    for group, power in _POWERS.items():
        values[layout.part(group)] = power
    return values


def compared(values: Floats, power: Floats, gain: int, common: float) -> tuple[Floats, Floats]:
    """Parameters [p] at the common gain, and the derivatives [p, p] by the parameters; `gain`: place of the gain."""
    factor = (values[gain] / common) ** power
    result = values * factor
    slope = np.diag(factor)
    slope[:, gain] += result * power / values[gain]
    return result, slope


def original(values: Floats, power: Floats, gain: int, common: float) -> tuple[Floats, Floats]:
    """The inverse of `compared`, and its derivatives [p, p]."""
    return compared(values, -power, gain, common)
