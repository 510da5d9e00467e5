"""What `acqd dataset build` is asked for, and what it reports."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from acqd.dataset.power import Measured
from acqd.dataset.regressors import TorqueSource

LONGEST_STEP_S = 10.0
"""Between the rows of a dataset."""


@dataclass(frozen=True, slots=True)
class BuildConfig:
    """Inputs and options of one build."""

    power: str
    """URL or file; "log": measured by the controller, in the logs."""
    logs: Path
    out: Path
    robot: str
    device: str | None = None
    channel: str | None = None
    torque: TorqueSource | None = None
    search_s: float = 2.4
    step_s: float = 0.04
    seed: int = 1
    lag_s: float | None = None
    """Lag of all logs if known; nothing is searched then."""
    cut_s: float | Literal["auto"] | None = None
    """Length of the pieces into which long logs are cut; "auto": chosen from the motion, None: only a single long log
    that needs no alignment is cut, 0: no log is cut."""
    append: bool = False
    """Put the logs into the dataset `out`, which exists."""
    zone: str | None = None
    """IANA name of the zone of power times that name none."""
    worked_min: float = 0.0
    """Minutes that the robot had worked when the first log begins: its gears are that warm."""


@dataclass(slots=True)
class BuildReport:
    """Result of one build."""

    out: str
    robot: str
    version: int = 1
    """How often recordings were put into the dataset."""
    recordings: int = 0
    """Written by this build."""
    seconds: float = 0.0
    refused: list[str] = field(default_factory=list)
    """Logs that could not be used or placed, with the reason."""
    known: int = 0
    """Logs that the dataset held already."""
    notes: list[str] = field(default_factory=list)
    offset_s: float | None = None
    drift_ppm: float | None = None
    scatter_ms: float | None = None
    own_lags_s: list[float] = field(default_factory=list)
    """Of recordings that were aligned without a common clock: controller clock minus power clock."""
    supply_lag_ms: float = 0.0
    split: dict[str, int] = field(default_factory=dict)
    measured: Measured = "mains"
