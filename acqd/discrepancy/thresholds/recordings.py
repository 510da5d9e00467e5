"""Recordings that the loop works on."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.discrepancy.thresholds.threshold import threshold


@dataclass(frozen=True)
class RecordingThresholds:
    """Recordings that the loop works on."""

    fewest_recordings: int = threshold(
        4,
        "recordings",
        "recordings",
        "choice",
        "fewest recordings for which a jackknife over recordings has a spread",
    )
    shortest_total_s: float = threshold(
        20.0, "s", "recordings", "study", "shortest duration of all recordings together"
    )
    fewest_for_one_in_five: int = threshold(
        12,
        "recordings",
        "recordings",
        "convention",
        "with fewer recordings, every fourth is held out instead of every fifth",
    )
    held_out_share: float = threshold(0.2, "-", "recordings", "convention", "share of recordings that are held out")
    few_every: int = threshold(4, "recordings", "recordings", "choice", "every which recording is held out of few")
