"""The time profile of one synchronous point-to-point motion (thesis 5.3).

All axes follow one common path parameter s(t). Its velocity is a trapezoid, smoothed by a moving average so that the
acceleration is continuous.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats

SMOOTHING_S = 0.06
"""Width of the moving average: jerk stays below acceleration divided by it."""


@dataclass(frozen=True, slots=True)
class Profile:
    """s(t) from 0 to 1: ramp up, cruise, ramp down; the velocity is averaged over `smoothing`. All times in s."""

    ramp: float
    cruise: float
    smoothing: float = SMOOTHING_S

    @property
    def duration(self) -> float:
        """Total time (s)."""
        return 2 * self.ramp + self.cruise + self.smoothing

    def at(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """s, ds/dt and d2s/dt2 at times `t` (s) since the start; at rest before and after the motion."""
        t = np.clip(t, 0.0, self.duration)
        peak = 1.0 / (self.ramp + self.cruise)
        jerk = peak / (self.ramp * self.smoothing)
        corners = (0.0, self.ramp, self.ramp + self.cruise, 2 * self.ramp + self.cruise)
        s, sd, sdd = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
        for corner, sign in zip(corners, (1, -1, -1, 1), strict=True):
            for delay, turn in ((0.0, sign), (self.smoothing, -sign)):
                since = np.maximum(t - corner - delay, 0.0)
                sdd += turn * since
                squared = since * since
                sd += turn * squared
                s += turn * squared * since
        return np.clip(s * (jerk / 6), 0.0, 1.0), sd * (jerk / 2), sdd * jerk


def fastest_profile(distance: Floats, speed: Floats, acceleration: Floats) -> Profile:
    """The shortest profile along `distance` [axes] (rad) within `speed` (rad/s) and `acceleration` (rad/s^2).

    `distance` must not be all zero. A moving average never exceeds the limits of the profile that it smooths.
    """
    length = np.maximum(np.abs(distance), 1e-12)
    top_speed = float((speed / length).min())
    top_acceleration = float((acceleration / length).min())
    if top_speed**2 >= top_acceleration:
        return Profile(ramp=float(top_acceleration**-0.5), cruise=0.0)
    return Profile(ramp=top_speed / top_acceleration, cruise=1 / top_speed - top_speed / top_acceleration)
