"""The quantities of the selection: five that are physics or convention, and settings of its methods."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class SelectionThresholds:
    """The quantities of the selection."""

    column_error: float = threshold(
        0.15, "-", "selection", "study", "kappa: relative error of an effect's columns, by wrong masses and frictions"
    )
    chance: float = threshold(
        0.02, "probability", "selection", "convention", "pi: probability of a name where nothing is"
    )
    usual_surprise: float = threshold(
        1.6, "mean square of z", "selection", "study", "of any effect in an unchanged session, before any was compared"
    )
    usual_difference: float = threshold(
        0.001,
        "of the dynamic range",
        "selection",
        "study",
        "tau: what unchanged sessions differ by, before any was compared",
    )
    few_sessions: float = threshold(
        3.0, "sessions", "selection", "choice", "weight of usual values against the spread of the reference sessions"
    )
    least_share_of_range: float = threshold(
        0.0025, "-", "selection", "physics", "delta: least RMS while acting, relative to the dynamic range"
    )
    largest_change: float = threshold(
        0.1, "of the dynamic range", "selection", "physics", "prior deviation of a size that nothing describes, RMS"
    )
    acting_share: float = threshold(
        0.05, "-", "selection", "choice", "an effect acts where its power exceeds this share of its largest power"
    )
