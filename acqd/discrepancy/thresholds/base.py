"""Blocks, and the base model's freedom."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class BaseThresholds:
    """Blocks, and the base model's freedom."""

    block_least_rows: int = threshold(
        40, "rows", "noise", "choice", "shortest block; a segment of two seconds has more rows of known motion"
    )
    lag_deviation_s: float = threshold(
        0.003, "s", "noise", "study", "prior deviation of the supply's lag, which else trades against clock offsets"
    )
    base_change: float = threshold(
        1.0, "-", "noise", "study", "prior deviation of friction and losses of the base model, relative to their values"
    )
    base_least_change: float = threshold(
        0.02, "of the torque limit", "noise", "study", "the same where the values are small; also W per W/Nm of loss"
    )
    common_share: float = threshold(
        0.1,
        "-",
        "noise",
        "study",
        "mean square of a column in the reference, relative to the recordings in question, "
        "above which both share the column",
    )
