"""Delay of the measured power behind the motion, per recording; estimated before any effect is searched.

A clock offset of a tenth of a second would be explained by many effects, but is not an effect of the robot.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from acqd.arrays import Floats
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance
from acqd.models.effects.scene import Scene
from acqd.models.segments import Segment
from acqd.numerics import mad_sigma, theil_sen_slope

_KINDS = 2
"""Of hypotheses about clocks: a constant offset, and a drift."""


@dataclass(frozen=True, slots=True)
class Delay:
    """Power is later than motion by offset_s + rate (t - origin_s)."""

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
        """Whether the delay changes in time."""
        return self.rate != 0.0

    def line(self) -> tuple[float, float]:
        """Slope [s/s] of the delays of the recordings over time, and its standard error."""
        t, delays = (np.array(each) for each in zip(*self.single, strict=True))
        slope, _, error = _line(t - t.min(), delays)
        return slope, error


def find_delay(scenes: Iterable[Scene], segments: list[Segment]) -> Delay | None:
    """A drift, or a constant delay, of all recordings; None if power and motion are aligned."""
    measured = [
        (float(scene.t.mean()), *_best(scene, segment.P)) for scene, segment in zip(scenes, segments, strict=True)
    ]
    usable = [(t, delay, gain) for t, delay, gain, moving in measured if moving > THRESHOLDS.delay_least_moving_W]
    if len(usable) < THRESHOLDS.few_recordings:
        return None
    t, delays, gains = (np.array(each) for each in zip(*usable, strict=True))
    if np.median(gains) < THRESHOLDS.column_error:  # wrong columns, too, gain something by a shift
        return None
    origin = float(t.min())
    middle = float(np.median(delays))
    spread = _spread(delays)
    rate, offset, rate_error = _line(t - origin, delays)
    left = _about_line(delays - offset - rate * (t - origin)) + 1e-4
    span = float(np.ptp(t))
    single = list(zip(t.tolist(), delays.tolist(), strict=True))
    if abs(rate) * span > THRESHOLDS.delay_smallest_s and _gain(len(t), spread, left) - np.log(len(t)) > by_chance(
        _KINDS
    ):
        return Delay(offset, rate, origin, left / np.sqrt(len(t)), rate_error, single)
    error = spread / np.sqrt(len(t))
    if abs(middle) > THRESHOLDS.delay_smallest_s and agreed(delays):
        return Delay(middle, 0.0, origin, error, 0.0, single)
    return None


def beyond_reference(delay: Delay, scenes: Iterable[Scene], segments: list[Segment]) -> Delay | None:
    """The delay less the median delay of unchanged recordings: a model's lag is right to some milliseconds only.

    None where too little of a constant delay remains.
    """
    measured = [_best(scene, segment.P) for scene, segment in zip(scenes, segments, strict=True)]
    delays = np.array([each for each, _, moving in measured if moving > THRESHOLDS.delay_least_moving_W])
    if len(delays) < THRESHOLDS.few_recordings:
        return delay
    usual = float(np.median(delays))
    if not delay.drifts and abs(delay.offset_s - usual) <= THRESHOLDS.delay_smallest_s:
        return None
    error = float(np.hypot(delay.offset_error_s, mad_sigma(delays, usual) / np.sqrt(len(delays))))
    single = [(t, each - usual) for t, each in delay.single]
    return replace(delay, offset_s=delay.offset_s - usual, offset_error_s=error, single=single)


def single_delay(scene: Scene, P: Floats) -> float | None:
    """s that the power of a recording is later than its motion; None if the power hardly changes."""
    delay, _, moving = _best(scene, P)
    return delay if moving > THRESHOLDS.delay_least_moving_W else None


def corrected(segment: Segment, delay: Delay, step_s: float) -> Segment:
    """The segment with its power shifted to the motion."""
    t: Floats = segment.start_s + step_s * np.arange(len(segment.P), dtype=np.float64)
    return replace(segment, P=np.interp(t + delay.at(t), t, segment.P))


def agreed(delays: Floats) -> bool:
    """Whether the delays [recordings] s of recordings scatter about one that is not zero."""
    spread = _spread(delays)
    return _gain(len(delays), np.hypot(spread, np.median(delays)), spread) > by_chance(_KINDS)


def _spread(delays: Floats) -> float:
    return mad_sigma(delays) + 1e-4


def _gain(count: int, before_s: float, after_s: float) -> float:
    """Twice the log-likelihood ratio of two deviations of so many normal values."""
    return float(2 * count * np.log(before_s / after_s))


def _line(t: Floats, delays: Floats) -> tuple[float, float, float]:
    """Slope (Theil-Sen), value at 0 and standard error of the slope."""
    slope = theil_sen_slope(t, delays, least_apart=1.0)
    offset = float(np.median(delays - slope * t))
    left = delays - offset - slope * t
    error = _about_line(left) / max(float(np.sqrt(((t - t.mean()) ** 2).sum())), 1e-9)
    return slope, offset, error + 1e-12


def _about_line(left: Floats) -> float:
    """Robust deviation of residuals [recordings] of a line, which passes through two whatever their scatter."""
    return mad_sigma(np.sort(np.abs(left))[2:], 0.0)


def _best(scene: Scene, P: Floats) -> tuple[float, float, float]:
    return delay_of(scene.predicted, P, scene.step_s)


def delay_of(predicted: Floats, P: Floats, step_s: float) -> tuple[float, float, float]:
    """Delay of P [T] W behind `predicted` [T] W.

    Delay in s, share of the residual's variance that the delay explains, standard deviation of `predicted` in W.
    """
    moving = float(predicted.std())
    t = step_s * np.arange(len(P))
    inside = slice(int(THRESHOLDS.delay_reach_s / step_s) + 1, -int(THRESHOLDS.delay_reach_s / step_s) - 1)
    if len(t[inside]) < THRESHOLDS.block_least_rows or moving <= THRESHOLDS.delay_least_moving_W:
        return 0.0, 0.0, moving
    curve = CubicSpline(t, predicted)
    reach = round(THRESHOLDS.delay_reach_s / step_s)
    tried = 0.5 * step_s * np.arange(-2 * reach, 2 * reach + 1)

    def left(delay: float) -> float:
        return float(np.var(P[inside] - curve(t[inside] - delay)))

    variances = np.array([left(delay) for delay in tried])
    at = int(variances.argmin())
    if at in (0, len(tried) - 1):
        return 0.0, 0.0, moving
    # the gain belongs to the refined delay: at the grid's own points, a delay below half a step would gain nothing
    best = minimize_scalar(left, bounds=(tried[at - 1], tried[at + 1]), method="bounded", options={"xatol": 1e-4})
    gain = 1 - float(best.fun) / max(left(0.0), 1e-12)
    return float(best.x), float(gain), moving
