"""Recordings that the loop works on."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


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
    few_recordings: int = threshold(
        3,
        "recordings",
        "recordings",
        "choice",
        "fewest recordings for a spread, and beside an onset",
    )
    held_out_every: int = threshold(4, "recordings", "recordings", "convention", "every which recording is held out")
