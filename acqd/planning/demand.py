"""What is asked of an installation: robots, rows, how long they are kept, on which computers."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal, get_args

from acqd.errors import UserError

Quality = Literal["off", "10/12", "150/180", "10min"]
"""`[quality] interval`, or off."""


@dataclass(frozen=True, slots=True)
class Demand:
    """A number of robots, with a box of three phases for each. Raises UserError for what cannot be planned."""

    robots: int
    channels: int = 4
    """L1, L2, L3 and total."""
    rows_per_second: float = 25.0
    """Of a channel."""
    quality: Quality = "off"
    archive_days: float = 0.0
    """Days of samples on the disk of the measurement PC; 0: no archive."""
    days: float | None = None
    """Days of rows in the database; None: what `disk_gb` holds, and without it the default of `[sink] keep_days`."""
    disk_gb: float | None = None
    """For the tables of a database; None: as much as is needed."""
    cores: int = 2
    """Of a measurement PC."""
    boxes: int = 8
    """At one PC at most; 8 is the largest number that was measured."""
    load: float = 0.5
    """Share of a core that may be busy."""

    def __post_init__(self) -> None:
        limits: dict[str, tuple[float, float]] = {
            "robots": (1, 1_000_000), "channels": (1, 4), "rows_per_second": (0.001, 25), "archive_days": (0, 3_650),
            "days": (0.01, 36_500), "disk_gb": (0.001, 1e9), "cores": (1, 1_024), "boxes": (1, 1_000),
            "load": (0.05, 0.95),
        }  # fmt: skip
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in limits and value is not None:
                least, most = limits[field.name]
                if not (math.isfinite(value) and least <= value <= most):
                    name = {"robots": "N", "archive_days": "--archive", "disk_gb": "--disk"}.get(
                        field.name, f"--{field.name.replace('_', '-')}"
                    )
                    raise UserError(f"{name} {value:g}: expected a number from {least:g} to {most:,.15g}")
        if self.quality not in get_args(Quality):
            raise UserError(f"--quality {self.quality}: expected one of {', '.join(get_args(Quality))}")
