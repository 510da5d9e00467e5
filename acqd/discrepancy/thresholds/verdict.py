"""Verdict."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class VerdictThresholds:
    """Verdict."""

    enough_s: float = threshold(
        120.0, "s", "verdict", "study", "with shorter recordings, silence does not prove absence"
    )
    least_confidence: float = threshold(
        0.85, "-", "verdict", "study", "with less confidence, an effect is a hypothesis and no finding"
    )
    usual_growth: float = threshold(
        0.2, "log of RMS", "verdict", "choice", "spread of the errors of unchanged recordings, before any was compared"
    )
