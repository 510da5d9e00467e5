"""Colours of the causes of power, the same on every page and picture."""

from __future__ import annotations

CAUSES = {
    "standby": "#94a3b8", "potential energy": "#0e7490", "kinetic energy": "#67b7dc", "dry friction": "#b45309",
    "viscous friction": "#e0a458", "cold friction": "#c77dff", "copper": "#c0392b", "drives and supply": "#8d6e63",
    "brakes": "#7c9a3a", "tool": "#059669", "load on the arm": "#7c3aed", "burnt while braking": "#e83e8c",
    "other loads": "#5b7083", "meter and clocks": "#4d4d4d", "without a name": "#b8a9c9",
}  # fmt: skip
"""#rrggbb by the name of a cause (`acqd.models.effects.cause`)."""
REST = "#94a3b8"
"""What is unexplained."""
PLAIN = "#5b7083"
"""What has no cause."""
FOUND = ("#7c3aed", "#c0392b", "#0e7490", "#b45309", "#059669", "#e83e8c")
"""Effects that the loop has found, in their order."""
