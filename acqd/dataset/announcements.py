"""What the user should know about the clock of a controller and about the uncertainty of its lags."""

from __future__ import annotations

from acqd.dataset.clock_line import ClockLine
from acqd.dataset.supply_lag import SupplyLag
from acqd.numerics import NORMAL_95

ANNOUNCED_S = 0.01
"""A 95 % interval that is wider than +- this is announced."""


def step_notes(line: ClockLine | None, names: list[str]) -> list[str]:
    """One line for every time the clock was set."""
    if line is None:
        return []
    return [
        f"the robot's clock was set by {1000 * step.seconds:+.0f} ms between {names[step.after]} and "
        f"{names[step.before]}; the clock line has a step there"
        for step in line.steps
    ]


def supply_notes(within_s: list[float], supply: SupplyLag) -> list[str]:
    """One line if the supply makes lags uncertain; `within_s` holds half the width of each lag's 95 % interval."""
    if supply.meter:
        return [f"{supply.meter}. The lags are uncertain by {1000 * max(within_s, default=0.0):.0f} ms (95 %)"]
    wide = [within for within in within_s if within > ANNOUNCED_S]
    if not wide or NORMAL_95 * supply.shared_error_s < ANNOUNCED_S / 2:
        return []  # then each wide interval is announced with its recording
    supply_ms = 1000 * supply.seconds, 1000 * NORMAL_95 * supply.error_s
    return [
        f"{len(wide)} of {len(within_s)} lags are uncertain by up to {1000 * max(wide):.0f} ms (95 %), most of it "
        f"together: the supply's lag is {supply_ms[0]:.0f} +- {supply_ms[1]:.0f} ms"
    ]
