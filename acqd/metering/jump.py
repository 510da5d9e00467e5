"""The cycle of a window that a phase jump leaves whole.

Two cycles with a phase jump in them are no whole number of periods: their RMS is off by up to sin(jump) / 8. The jump
lies in one of the two, and the other one is as it should be. A step of the voltage, in contrast, is part of the RMS of
its window.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from acqd.arrays import Floats
from acqd.metering.interval import interval_sums

_LEAST = 0.02
"""rad between the phasors of neighbouring cycles; a smaller jump moves the RMS by less than 0.3 %."""
_ALIKE = 0.004
"""Change of ln(magnitude) and phase between cycles that the mains has anyway."""
_TURNS = 3.0
"""A jump turns the phasor by so many times what it changes ln(magnitude) by; a step of the voltage by a tenth of it."""


def whole_cycle(u: Floats, start: float, stop: float) -> tuple[float, float] | None:
    """Bounds of the cycle without the jump, of two in start .. stop [samples] of `u` [phases, samples].

    None where there is no jump between the cycles, or no cycle before them that they could be compared with.
    """
    period = (stop - start) / 2
    if start < period:
        return None
    begins = np.array((start - period, start, start + period))
    first, last = int(begins[0]), min(math.ceil(stop) + 1, u.shape[1])
    turn = np.exp(-2j * np.pi / period * (np.arange(first, last) + 0.5 - start))
    part = u[:, first:last]
    edges = begins - first, np.minimum(begins + period - first, part.shape[1])
    phasors = interval_sums(part * turn.real, *edges) + 1j * interval_sums(part * turn.imag, *edges)
    before, one, other = phasors.T
    into, out_of = _change(before, one), _change(one, other)
    if not (_jumps(into) or _jumps(out_of)):
        return None
    # In the second cycle: the first one is like the one before. In the first: the second one is whole.
    return (start, start + period) if abs(into) < _ALIKE else (start + period, stop)


def _change(one: np.ndarray, other: np.ndarray) -> complex:
    """ln(magnitude) and phase [rad] of the phasors of all phases from one cycle to the next."""
    joint = complex((one.conj() * other).sum())
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    if not joint or not size:
        return 0j
    magnitude = float(np.linalg.norm(other) / np.linalg.norm(one))
    return complex(math.log(magnitude), cmath.phase(joint))


def _jumps(change: complex) -> bool:
    return abs(change.imag) > max(_LEAST, _TURNS * abs(change.real))
