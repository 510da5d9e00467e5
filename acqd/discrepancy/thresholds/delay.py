"""Delay between power and motion."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class DelayThresholds:
    """Delay between power and motion."""

    delay_reach_s: float = threshold(0.8, "s", "delay", "study", "longest delay that is tried")
    delay_smallest_s: float = threshold(
        0.012, "s", "delay", "study", "smaller delays compete as an effect with the other effects"
    )
    delay_floor_s: float = threshold(
        0.001, "s", "delay", "study", "error of every delay besides its scatter: motion between rows, the supply's lag"
    )
    delay_least_moving_W: float = threshold(
        3.0, "W", "delay", "study", "least standard deviation of the predicted power for a delay to be measurable"
    )
    drift_deviation: float = threshold(
        30e-6, "s/s", "delay", "physics", "prior deviation of the drift between two clocks: quartz crystals"
    )
