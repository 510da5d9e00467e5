"""Limits of EN 50160:2010 for low voltage, and the classes of its table of events."""

from __future__ import annotations

WEEK_S = 7 * 86_400
SHARE = 0.95
"""Of the week's 10 min values that must be within their limit."""
VOLTAGE, VOLTAGE_ALWAYS = (0.90, 1.10), (0.85, 1.10)
"""Of Un: for 95 % and for all 10 min values (networks with connections)."""
FREQUENCY, FREQUENCY_SHARE, FREQUENCY_ALWAYS = 0.01, 0.995, (0.94, 1.04)
"""Of the nominal frequency: 10 s values of a synchronous network. The 99.5 % are those of a year."""
UNBALANCE, THD, PLT = 2.0, 8.0, 1.0
"""%, %, 1."""
HARMONICS: dict[int, float] = {
    2: 2.0, 3: 5.0, 4: 1.0, 5: 6.0, 7: 5.0, 9: 1.5, 11: 3.5, 13: 3.0, 15: 0.5, 17: 2.0, 19: 1.5, 21: 0.5, 23: 1.5,
    25: 1.5, **dict.fromkeys(range(6, 25, 2), 0.5),
}  # fmt: skip
"""Order: % of the fundamental."""
RESIDUAL = ((0.80, 0.90), (0.70, 0.80), (0.40, 0.70), (0.05, 0.40), (0.0, 0.05))
"""Classes of dips and interruptions: residual voltage, from and below, of the reference."""
SWELLS = ((1.20, 9.0), (1.10, 1.20))
"""Classes of swells: highest voltage, from and below."""
DURATIONS_S = ((0.0, 0.2), (0.2, 0.5), (0.5, 1.0), (1.0, 5.0), (5.0, 60.0), (60.0, float("inf")))
"""Classes of durations: above and up to."""
EVENT_FLAGS = frozenset({"dip", "swell", "interruption"})
"""Values with these flags count events twice; the statistics leave them out (IEC 61000-4-30, section 4.7)."""
INCOMPLETE_FLAGS = frozenset({"gap", "overrange", "off_nominal"})
"""Values with these flags are not those of their whole interval, or not the true ones."""
COMPLETE = 0.95
"""Share of the week that must be known for a verdict; the standard names none."""
