"""What the best of several hypotheses reaches where nothing is."""

from __future__ import annotations

from math import log

from acqd.discrepancy.thresholds import THRESHOLDS


def by_chance(kinds: int) -> float:
    """Evidence that the best of so many kinds of hypotheses exceeds with the probability `chance` where nothing is.

    Twice the log of prior odds `chance` that are shared between the kinds (ADR 26).
    """
    return 2 * log(kinds / THRESHOLDS.chance)
