"""Verdict."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.discrepancy.thresholds.threshold import threshold


@dataclass(frozen=True)
class VerdictThresholds:
    """Verdict."""

    enough_s: float = threshold(
        120.0, "s", "verdict", "study", "with shorter recordings, silence does not prove absence"
    )
    fair_share: float = threshold(
        0.15, "-", "verdict", "choice", "least share of the excess over the reference that found effects explain"
    )
    grown_quantile: float = threshold(
        0.95, "-", "verdict", "convention", "quantile of the errors of reference recordings: a larger error has grown"
    )
    grown_factor: float = threshold(
        1.25,
        "-",
        "verdict",
        "choice",
        "by which the error of new recordings may exceed that quantile: they were not fitted",
    )
    family_correlation: float = threshold(
        0.95, "-", "verdict", "convention", "effects whose powers correlate more are one family in these recordings"
    )
    least_confidence: float = threshold(
        0.85, "-", "verdict", "study", "with less confidence, an effect is a hypothesis and no finding"
    )
