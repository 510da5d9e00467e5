"""What a playback reports: counts of the run, means per file and channel."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from acqd.metering import WindowBatch
from acqd.telemetry.row import CHANNELS


@dataclass(slots=True)
class ChannelReport:
    """One channel of one file: means over its windows (V, A, W, Hz), W at the end (kWh), windows per flag."""

    file: str
    channel: str
    windows: int = 0
    Vrms: float | None = None
    Irms: float | None = None
    P: float | None = None
    f: float | None = None
    W: float = 0.0
    flagged: dict[str, int] = field(default_factory=dict)


@dataclass(slots=True)
class PlaybackReport:
    """The whole run."""

    rows: int = 0
    recorded_s: float = 0.0
    elapsed_s: float = 0.0
    unused_samples: int = 0
    """Samples after the last whole windows."""
    events: int = 0
    """Voltage events, where they are wanted."""
    channels: list[ChannelReport] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """How files were read, where that is not the only way."""


def describe(file: str, batch: WindowBatch) -> list[ChannelReport]:
    """A report for each phase of one file, all of whose windows are in `batch`."""
    reports = []
    for phase in range(len(batch.P)):
        counts = Counter(flag for flags in batch.flags[phase] for flag in flags)
        reports.append(
            ChannelReport(
                file=file,
                channel=CHANNELS[phase],
                windows=len(batch),
                Vrms=_mean(batch.Vrms[phase]),
                Irms=_mean(batch.Irms[phase]),
                P=_mean(batch.P[phase]),
                f=_mean(batch.f),
                W=float(batch.W[phase, -1]),
                flagged=dict(counts),
            )
        )
    return reports


def _mean(values: np.ndarray) -> float | None:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else None
