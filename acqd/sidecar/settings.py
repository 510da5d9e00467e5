"""Settings of a sidecar's worker."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Settings:
    """Model, power rows, and limits of time."""

    bundle: Path
    database: str
    device: str | None = None
    channel: str | None = None
    patience_s: float = 10.0
    """How long the rows of a log's last moments may take to arrive in the database."""
    between_s: float = 200 * 3600.0
    """Mean recorded time between false alarms."""
    clocks_apart_s: float = 120.0
    """How far the clocks of robot and power meter may differ."""
