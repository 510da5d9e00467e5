"""Detectors in the residual."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.threshold import threshold


@dataclass(frozen=True)
class DetectorThresholds:
    """Detectors in the residual."""

    ripple_fewest_periods: float = threshold(
        2.0, "periods", "detectors", "physics", "over the recorded travel of a joint, of the slowest ripple"
    )
    ripple_most_periods: float = threshold(130.0, "per turn", "detectors", "physics", "fastest ripple that is searched")
    switching_rarest: float = threshold(0.005, "-", "detectors", "study", "least share of time on, and of time off")
    walk_s: float = threshold(
        20.0, "s", "detectors", "choice", "a moving average over this time must explain less than a load that switches"
    )
    rhythm_shortest_s: float = threshold(
        12.0, "s", "detectors", "physics", "no heater or fan switches with a shorter period"
    )
