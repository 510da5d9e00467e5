"""Prints the quantities and the settings of the loop: `python -m acqd.discrepancy.thresholds`."""

from __future__ import annotations

from typing import get_args

from acqd.discrepancy.thresholds import OF_THE_LOOP
from acqd.threshold import Stage, described, table

_QUANTITIES = (
    "column_error", "usual_surprise", "usual_difference", "few_sessions", "usual_growth", "chance",
    "least_share_of_range", "largest_change", "least_confidence",
)  # fmt: skip


def quantities() -> str:
    """A table of what decides between a residual and a verdict: kappa, tau, pi, delta and p."""
    return table([each for each in described(OF_THE_LOOP, get_args(Stage)) if each["name"] in _QUANTITIES])


def settings() -> str:
    """A table of the settings of the methods."""
    return table([each for each in described(OF_THE_LOOP, get_args(Stage)) if each["name"] not in _QUANTITIES])


if __name__ == "__main__":
    print(f"Quantities\n\n{quantities()}\n\nSettings of the methods\n\n{settings()}")
