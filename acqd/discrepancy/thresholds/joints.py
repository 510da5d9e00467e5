"""Logged joint torques."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class JointThresholds:
    """Logged joint torques."""

    joint_noise_order: int = threshold(10, "rows", "joints", "choice", "order of the noise model of a joint's torque")
    joint_rows_per_order: int = threshold(
        20,
        "rows",
        "joints",
        "choice",
        "reference rows of a joint per order of its noise model, at least",
    )
    joint_longest_s: float = threshold(
        1200.0, "s", "joints", "choice", "longest duration of logged torques of one side that is used"
    )
    friction_spread: float = threshold(
        0.15, "-", "joints", "choice", "relative standard deviation of friction from session to session (UR10e)"
    )
    usual_dispersion: float = threshold(
        30.0, "-", "joints", "choice", "mean square of z in unchanged sessions (UR10e), before sessions were compared"
    )
