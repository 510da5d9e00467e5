"""What a run of the loop is asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from acqd.models.yearly import Duty


@dataclass(frozen=True, slots=True)
class CloseConfig:
    """One run of `acqd close-loop`."""

    dataset: Path
    bundle: Path
    out: Path
    reference: Path | None = None
    """Dataset to compare with; None: the recordings that the bundle remembers."""
    max_effects: int = 5
    only: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    seed: int = 1
    robot: str | None = None
    """Description; None: the bundle's."""
    since_s: float | None = None
    """UTC (Unix s); recordings that end before are left out."""
    duty: Duty = field(default_factory=Duty)
    """For the energy and the cost of a cause per year."""
