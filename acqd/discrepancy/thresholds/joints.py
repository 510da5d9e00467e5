"""Logged joint torques."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.discrepancy.thresholds.threshold import threshold


@dataclass(frozen=True)
class JointThresholds:
    """Logged joint torques."""

    stick_rad_s: float = threshold(
        0.03, "rad/s", "joints", "physics", "a slower joint may stick, and its motor carries any torque up to breakaway"
    )
    joint_least_rows: int = threshold(12, "rows", "joints", "choice", "shortest run of motion of a joint")
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
    torque_least_Nm: float = threshold(
        0.3, "Nm", "joints", "physics", "least RMS difference of a logged torque that is called a change"
    )
    joint_growth: float = threshold(
        1.5, "-", "joints", "choice", "a joint has changed if its RMS difference has grown by this factor"
    )
    joint_evidence: float = threshold(
        12.0, "twice log-likelihood ratio", "joints", "convention", "logged torques show an effect (p < 0.001)"
    )
