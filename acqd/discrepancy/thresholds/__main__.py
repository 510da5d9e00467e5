"""Prints the quantities and the settings of the loop: `python -m acqd.discrepancy.thresholds`."""

from __future__ import annotations

from dataclasses import fields

from acqd.discrepancy.thresholds import Thresholds, table

QUANTITIES = (
    "column_error", "usual_surprise", "usual_difference", "few_sessions", "days_differ", "usual_growth", "chance",
    "least_share_of_range", "largest_change", "least_confidence",
)  # fmt: skip
"""What decides between a residual and a verdict: kappa, tau, pi, delta and p."""

if __name__ == "__main__":
    print(f"Quantities\n\n{table(QUANTITIES)}\n")
    rest = [each.name for each in fields(Thresholds) if each.name not in QUANTITIES]
    print(f"Settings of the methods\n\n{table(rest)}")
