"""Thresholds of the sequential test."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class MonitorThresholds:
    """Sequential test."""

    cusum_block_s: float = threshold(10.0, "s", "monitor", "study", "duration of a block of the charts")
    cusum_clip: float = threshold(
        4.0, "sigma", "monitor", "study", "bound of one block's contribution: a protective stop is no change"
    )
    cusum_slack: float = threshold(
        0.75, "sigma", "monitor", "convention", "slack k of the CUSUM: shifts of twice this size are found soonest"
    )
    cusum_moving_W: float = threshold(
        2.0, "W", "monitor", "study", "standard deviation of predicted power of a moving block"
    )
    cusum_rest_s: float = threshold(0.5, "s", "monitor", "study", "a recording starts at rest: at least so long")
    cusum_peak_s: float = threshold(0.2, "s", "monitor", "study", "a peak at the start is a mean over this time")
    cusum_tail_share: float = threshold(
        0.1, "of the rows", "monitor", "convention", "high and low power: beyond the upper and the lower decile"
    )
    cusum_fewest_blocks: int = threshold(12, "blocks", "monitor", "study", "fewest blocks of a baseline")
    cusum_step: float = threshold(1.0, "sigma", "monitor", "study", "least step that dates the onset")
    screen_level_share: float = threshold(
        0.02, "of the dynamic range", "monitor", "study", "drift of the standby power that a fleet's screen ignores"
    )
    screen_growth: float = threshold(
        1.25,
        "-",
        "monitor",
        "choice",
        "by which noise of new recordings may exceed that of the baseline: they were not fitted",
    )
    cusum_remembered: int = threshold(2000, "blocks", "monitor", "choice", "blocks kept since a chart left zero")


MONITOR = MonitorThresholds()
"""The values in use."""
