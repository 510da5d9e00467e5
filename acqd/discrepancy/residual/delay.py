"""How late power is against motion, recording by recording: looked at before anything else.

A clock that is off by a tenth of a second makes every other effect look guilty, and is no effect of the robot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene
from acqd.models.segments import Segment
from acqd.numerics import mad_sigma, theil_sen_slope

_REACH_S, _STEP_S = 0.8, 0.02
_LEAST_S = 0.012  # less is left to the tracing, where it competes
_LEAST_GAIN = 0.15  # of the residual's variance
_LEAST_MOVING_W = 3.0


@dataclass(frozen=True, slots=True)
class Delay:
    """Power is later than motion says by offset_s + rate * (t - origin_s)."""

    offset_s: float
    rate: float
    """s/s."""
    origin_s: float
    """UTC."""
    offset_error_s: float
    """Standard error."""
    rate_error: float
    single: list[tuple[float, float]]
    """UTC [s] and delay [s] of each recording."""

    def at(self, t: Floats | float) -> Floats:
        """s, at UTC `t`."""
        return np.asarray(self.offset_s + self.rate * (np.asarray(t) - self.origin_s))

    @property
    def drifts(self) -> bool:
        """Whether it is a drift rather than a jump."""
        return self.rate != 0.0


def find_delay(scenes: list[Scene], segments: list[Segment]) -> Delay | None:
    """None where power and motion are together."""
    found = [(scene, *_best(scene, segment.P)) for scene, segment in zip(scenes, segments, strict=True)]
    usable = [(float(scene.t.mean()), delay, gain) for scene, delay, gain, moving in found if moving > _LEAST_MOVING_W]
    if len(usable) < 3:
        return None
    t, delays, gains = (np.array(each) for each in zip(*usable, strict=True))
    if np.median(gains) < _LEAST_GAIN:
        return None
    origin = float(t.min())
    middle = float(np.median(delays))
    spread = mad_sigma(delays, middle) + 1e-4
    rate, offset, rate_error = _line(t - origin, delays)
    left = mad_sigma(delays - offset - rate * (t - origin), 0.0) + 1e-4
    span = float(np.ptp(t))
    single = list(zip(t.tolist(), delays.tolist(), strict=True))
    if abs(rate) * span > _LEAST_S and abs(rate) > 5 * rate_error and left < 0.6 * spread:
        return Delay(offset, rate, origin, left / np.sqrt(len(t)), rate_error, single)
    error = spread / np.sqrt(len(t))
    if abs(middle) > _LEAST_S and abs(middle) > 4 * error:
        return Delay(middle, 0.0, origin, error, 0.0, single)
    return None


def single_delay(scene: Scene, P: Floats) -> float | None:
    """s that the power of one recording is later than its motion; None where nothing moves."""
    delay, _, moving = _best(scene, P)
    return delay if moving > _LEAST_MOVING_W else None


def corrected(segment: Segment, delay: Delay, step_s: float) -> Segment:
    """The stretch with power where the motion is."""
    t: Floats = segment.start_s + step_s * np.arange(len(segment.P), dtype=np.float64)
    return replace(segment, P=np.interp(t + delay.at(t), t, segment.P))


def _line(t: Floats, delays: Floats) -> tuple[float, float, float]:
    """Slope, value at 0 and the slope's standard error, robust to single recordings (Theil, Sen)."""
    slope = theil_sen_slope(t, delays, least_apart=1.0)
    offset = float(np.median(delays - slope * t))
    left = delays - offset - slope * t
    error = mad_sigma(left, 0.0) / max(float(np.sqrt(((t - t.mean()) ** 2).sum())), 1e-9)
    return slope, offset, error + 1e-12


def _best(scene: Scene, P: Floats) -> tuple[float, float, float]:
    """Delay, the share of the residual's variance that it takes away, and how much power moves (W)."""
    return delay_of(scene.predicted, P, scene.step_s)


def delay_of(predicted: Floats, P: Floats, step_s: float) -> tuple[float, float, float]:
    """s that P [T] is later than `predicted` [T], the share of the residual's variance, how much power moves (W)."""
    moving = float(predicted.std())
    t = step_s * np.arange(len(P))
    inside = slice(int(_REACH_S / step_s) + 1, -int(_REACH_S / step_s) - 1)
    if len(t[inside]) < 50 or moving <= _LEAST_MOVING_W:
        return 0.0, 0.0, moving
    curve = CubicSpline(t, predicted)
    tried = np.arange(-_REACH_S, _REACH_S + _STEP_S / 2, _STEP_S)
    left = np.array([float(np.var(P[inside] - curve(t[inside] - delay))) for delay in tried])
    at = int(left.argmin())
    gain = 1 - left[at] / max(float(np.var((P - predicted)[inside])), 1e-12)
    if at in (0, len(tried) - 1):
        return 0.0, 0.0, moving
    a, b, _ = np.polyfit(tried[at - 1 : at + 2], left[at - 1 : at + 2], 2)
    return float(-b / (2 * a)), float(gain), moving
