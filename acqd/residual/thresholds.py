"""Thresholds of the noise model, which the loop and the monitor share."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class NoiseThresholds:
    """Noise of the residual, and rows that say nothing."""

    noise_order: int = threshold(30, "rows", "noise", "study", "order of the autoregressive noise model")
    block_rows: int = threshold(1500, "rows", "noise", "study", "longest block, which has a random level")
    outlier: float = threshold(
        6.0, "sigma", "noise", "choice", "white residuals of a fit of everything beyond are left out"
    )
    stick_rad_s: float = threshold(
        0.03, "rad/s", "joints", "physics", "a slower joint may stick, and its motor carries any torque up to breakaway"
    )


NOISE = NoiseThresholds()
"""The values in use."""
