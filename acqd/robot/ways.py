"""How far an arm moves from row to row, beside how far its stamps go on: an arm on its way tells the time.

From row to row an arm covers a way that changes little. Ways and steps are therefore told as multiples of the usual
ones around, and judged where the arm moves fast enough and goes somewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

FAST = 0.02
"""Share of the speed limits from which on a way tells the time."""
FEWEST = 60
"""Rows in motion that are judged."""
AROUND = 4
"""Rows on either side that tell the usual way and step."""
_STEPS_OF_ENCODER = 12.0
"""Steps of the written positions that a way needs."""
_AHEAD = 0.5
"""Distance covered over the ways between, of an arm that goes somewhere. The noise of encoders covers a ninth."""
_REGULAR = 0.7
"""Share of the distances between double ways that are the usual one, or differ by a row, of poses that come at another
rate than the rows. Rows that are lost by chance: below a half."""


@dataclass(frozen=True, slots=True)
class Ways:
    """What the steps between rows [T - 1] say; unjudged ones are NaN."""

    step: Floats
    """Step of the stamps over the usual one around it."""
    way: Floats
    """Way of the arm over the usual one around it."""
    three: Floats
    """Distance that the step and its neighbours cover together, over the usual way of one."""
    step_s: Floats
    """Usual step around it, s."""
    fast: NDArray[np.bool_]
    """Steps of a usual way, on the way to somewhere or to and fro."""

    @property
    def judged(self) -> NDArray[np.bool_]:
        """[T - 1] steps by which the time can be told."""
        return np.isfinite(self.way)


def ways_of(time: Floats, x: Floats, x_step: Floats) -> Ways | None:
    """Steps and ways over their usual sizes around; None with too few rows in motion."""
    if len(time) < 2 * AROUND + FEWEST:
        return None
    step_s, way = np.diff(time), np.linalg.norm(np.diff(x, axis=0), axis=1)
    usual_s, usual = _running_median(step_s), _running_median(way)
    chord = np.linalg.norm(x[2 * AROUND + 1 :] - x[: -2 * AROUND - 1], axis=1) / (2 * AROUND + 1)
    ahead = np.full(len(way), 0.0)
    ahead[AROUND:-AROUND] = chord
    typical_s = float(np.median(step_s))
    written = float(np.linalg.norm(x_step))
    fast = (usual > FAST * np.maximum(usual_s, typical_s)) & (usual > _STEPS_OF_ENCODER * written)
    # where the arm starts, stops or turns there is no usual way
    even = np.abs(usual - _shifted(usual)) < 0.3 * usual
    fast &= even & (ahead > 0)
    if fast.sum() < FEWEST:
        return None
    nan = np.full(len(way), np.nan)
    nan[fast & (ahead > _AHEAD * usual)] = 1.0
    three = np.pad(np.linalg.norm(x[3:] - x[:-3], axis=1), 1)
    usual = np.maximum(usual, 1e-12)
    return Ways(step_s / usual_s * nan, way / usual * nan, three / usual * nan, usual_s, fast)


def _shifted(usual: Floats) -> Floats:
    """The usual way of rows `AROUND` ahead or behind, whichever differs more."""
    padded = np.pad(usual, AROUND, mode="edge")
    ahead, behind = padded[2 * AROUND :], padded[: -2 * AROUND]
    return np.where(np.abs(ahead - usual) > np.abs(behind - usual), ahead, behind)


def at_another_rate(double: NDArray[np.bool_]) -> bool:
    """Whether steps across two poses [T - 1] come regularly.

    A recorder that is slower than the controller misses a pose every few rows, as a beat of both rates.
    """
    apart = np.diff(np.flatnonzero(double))
    return len(apart) >= FEWEST // 2 and bool((np.abs(apart - int(np.median(apart))) <= 1).mean() > _REGULAR)


def _running_median(values: Floats) -> Floats:
    """[T] median of nine values around each."""
    padded = np.pad(values, AROUND, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1), axis=1))
