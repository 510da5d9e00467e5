"""Confidence and intervals."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class UncertaintyThresholds:
    """Confidence and intervals."""

    shape_step: float = threshold(
        0.1, "-", "uncertainty", "choice", "step of a fitted shape for its interval, relative to the value"
    )
    interval_width: float = threshold(
        1.96, "standard errors", "uncertainty", "convention", "half width of a 95 % interval"
    )
    sensor_scale_deviation: float = threshold(
        0.02, "-", "uncertainty", "physics", "relative standard deviation of a torque sensor's scale"
    )
    column_deviation: float = threshold(
        0.04,
        "-",
        "uncertainty",
        "choice",
        "relative error of an effect's columns by the model's wrong torques and powers",
    )
