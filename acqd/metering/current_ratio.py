"""Does a ratio of current transformers that was set wrong explain a power that is far from that of the load?

A transformer of 50:5 that is set as 500:5 makes every power ten times too high, and no angle shows it. Ratios go in
steps: rated primary currents are those of IEC 61869-2, rated secondary currents 1 and 5 A, and a conductor goes through
a window a whole number of times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats

_LEAST = 1.8
"""Below, the load itself may be that far from its model: that is what acqd is there to name."""
NEAR = 0.05
"""How near the power must come to a step: a model of the load is within 3 %, transformers within 1 %."""
_ALIKE = 0.15
"""How far currents of a balanced load are from their mean [share]."""
_STEPS = np.array([step * 10.0**k for k in range(4) for step in (1, 2, 2.5, 3, 4, 5, 6, 7.5, 8)][1:])
"""Quotients of rated primary currents (10, 12.5, 15, 20, 25, 30, 40, 50, 60, 75 A and their decimal multiples), 5 A for
1 A, turns. Other quotients, such as 12.5:10, are nearer to 1 than a load is known."""


@dataclass(frozen=True, slots=True)
class WrongRatio:
    """What explains the power."""

    text: str
    gain: tuple[float, ...]
    """True current per measured one, of each phase."""


def wrong_ratio(P: Floats, currents: Floats, expected_W: float) -> WrongRatio | None:
    """Of powers [phases] in W and currents [phases] in A, and the power of the load; None where no ratio explains it.

    One of three may have another ratio, where the load is balanced, or all.
    """
    total = float(P.sum())
    if total <= 0 or expected_W <= 0:
        return None
    for k in range(3 if len(P) == 3 else 0):
        others = np.delete(currents, k)
        factor = _step(float(currents[k] / others.mean()))
        if factor is None or np.ptp(others) > _ALIKE * others.mean():
            continue
        corrected = total - P[k] + P[k] / factor
        if abs(corrected / expected_W - 1) < NEAR < abs(total / expected_W - 1):
            gain = tuple(_gain(factor) if j == k else 1.0 for j in range(3))
            return WrongRatio(f"i{k + 1} is {_times(factor)} (ratio of the transformer, or turns through it)", gain)
    factor = _step(total / expected_W)
    if factor is None:
        return None
    return WrongRatio(
        f"P is {total:.4g} W for a load of {expected_W:.4g} W: the currents are {_times(factor)} "
        "(ratio of the transformers, or turns through them)",
        (_gain(factor),) * len(P),
    )


def beyond_rated(P: Floats, rated_W: float) -> WrongRatio | None:
    """Of powers [phases] in W far above the rated one: 2, 5, 10, 100 or 1000 times, the first that explains them."""
    total = float(P.sum())
    if total < _LEAST * rated_W:
        return None
    factor = next((step for step in (2.0, 5.0, 10.0, 100.0) if total / step <= rated_W), 1000.0)
    return WrongRatio(
        f"P is {total:.4g} W, more than the {rated_W:.4g} W that the load takes at most: the currents are about "
        f"{_times(factor)}; the nameplates of the transformers say by how much",
        (_gain(factor),) * len(P),
    )


def _step(ratio: float) -> float | None:
    """The step of ratios that is near: measured per true current; None where no step is."""
    large = max(ratio, 1 / ratio) if ratio > 0 else 0.0
    if large < _LEAST:
        return None
    nearest = float(_STEPS[np.argmin(np.abs(np.log(_STEPS / large)))])
    if abs(large / nearest - 1) > NEAR:
        return None
    return nearest if ratio > 1 else 1 / nearest


def _gain(factor: float) -> float:
    return float(f"{1 / factor:.4g}")


def _times(factor: float) -> str:
    return f"{factor:.4g} times too large" if factor > 1 else f"{1 / factor:.4g} times too small"
