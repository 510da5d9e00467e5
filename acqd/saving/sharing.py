"""The durations of stretches and pauses that use the least energy in a given time together.

Every piece has energy against duration; on the lower convex hulls of these curves, the best division gives each second
to the piece that saves most by it, in turn (Fox 1966, Discrete optimization via marginal analysis).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError

_NEVER_S = 1e5
"""A pause may last as long as this."""
_EXACT_S = 1e-3
"""A row of motion: what is missing of a duration below that is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Energy of one piece against its duration, on the lower convex hull."""

    seconds: Floats
    """[k] rising."""
    energy: Floats
    """[k] J."""
    number: np.ndarray
    """[k] which of the points that the curve was made of."""

    @classmethod
    def hull(cls, seconds: Floats, energy: Floats) -> Curve:
        """The lower convex hull of points."""
        kept: list[int] = []
        for k in np.argsort(seconds).tolist():
            while len(kept) > 1:
                a, b = kept[-2], kept[-1]
                cross = (seconds[b] - seconds[a]) * (energy[k] - energy[a]) - (energy[b] - energy[a]) * (
                    seconds[k] - seconds[a]
                )
                if cross > 0:
                    break
                kept.pop()
            kept.append(k)
        return cls(seconds[kept], energy[kept], np.array(kept))

    @classmethod
    def pause(cls, least_s: float, power_W: float) -> Curve:
        """A pause of at least some duration with constant power."""
        ends = np.array([least_s, least_s + _NEVER_S])
        return cls(ends, power_W * (ends - least_s), np.arange(2))


def shared(curves: Sequence[Curve], total_s: float, besides_s: float = 0.0) -> list[float]:
    """The duration of every piece, s, for a given sum; `besides_s`: what else belongs to the cycle.

    Raises UserError where the pieces cannot be so fast, or so slow.
    """
    durations = [float(curve.seconds[0]) for curve in curves]
    left = total_s - sum(durations)
    if left < -1e-6:
        raise UserError(
            f"a cycle of {total_s + besides_s:.2f} s cannot be reached: within the limits the shortest is "
            f"{sum(durations) + besides_s:.2f} s"
        )
    parts = [
        (float(slope), owner, float(length))
        for owner, curve in enumerate(curves)
        for slope, length in zip(
            np.diff(curve.energy) / np.maximum(np.diff(curve.seconds), 1e-12), np.diff(curve.seconds), strict=True
        )
    ]
    for _, owner, length in sorted(parts, key=lambda part: part[0]):
        taken = min(length, left)
        durations[owner] += taken
        left -= taken
        if left <= 0:
            break
    if left > _EXACT_S:
        longest_s = total_s - left + besides_s
        raise UserError(f"a cycle of {total_s + besides_s:.2f} s cannot be reached: the longest is {longest_s:.2f} s")
    return durations
