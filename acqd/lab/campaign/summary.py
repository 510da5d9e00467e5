"""The figures of a whole campaign, from the reports of its sessions."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.lab.campaign.bookkeeping import SessionReport
from acqd.lab.campaign.folders import Folders
from acqd.lab.session import windows_within
from acqd.sources import el3783


@dataclass(slots=True)
class CampaignReport:
    """Result of `run_campaign`; `acqd lab campaign --json` prints it."""

    out: str
    truth: str
    database: str
    recordings: int = 0
    recorded_s: float = 0.0
    streamed_s: float = 0.0
    rows: int = 0
    sessions_done_before: int = 0
    sample_pairs: int = 0
    standby_W: float = 0.0
    spaces: dict[str, dict[str, float]] = field(default_factory=dict)
    """Per space: recordings, hours, mean, 99th percentile and maximum of metered P, RMS power of the effects (W)."""
    steady_error: dict[str, float] = field(default_factory=dict)
    """Relative error of metered against true power in steady state: RMS and worst window, worst second."""
    energy_unaccounted: float = 0.0
    """Energy balance error of the worst session, as a share of the supplied energy."""
    simulated: bool = True


def metered_powers(folders: Folders, reports: list[SessionReport]) -> dict[str, Floats]:
    """Metered P [windows] (W) of every recording, by `device/name`. Raises InputError."""
    powers = {}
    for report in reports:
        path = folders.truth / f"{report['session']}.npz"
        try:
            with np.load(path) as arrays:
                metered, window_s = arrays["P_metered_W"], float(arrays["window_s"])
        except (OSError, ValueError, KeyError, zipfile.BadZipFile):
            raise InputError(path, "is damaged; remove it and run the same command again") from None
        for recording in report["recordings"]:
            within = windows_within(recording["start_s"], recording["seconds"], window_s)
            powers[f"{report['device']}/{recording['name']}"] = metered[within]
    return powers


def summarise(
    folders: Folders, database: str, reports: list[SessionReport], powers: dict[str, Floats]
) -> CampaignReport:
    """Figures of a campaign from all its session reports and from `metered_powers`."""
    recordings = [
        recording | {"log": f"{report['device']}/{recording['name']}"}
        for report in reports
        for recording in report["recordings"]
    ]
    streamed_s = sum(report["seconds"] for report in reports)
    return CampaignReport(
        str(folders.out),
        str(folders.truth),
        database,
        recordings=len(recordings),
        recorded_s=sum(recording["seconds"] for recording in recordings),
        streamed_s=streamed_s,
        sample_pairs=round(streamed_s * el3783.RATE),
        standby_W=float(np.median([report["standby_W"] for report in reports])),
        spaces={
            space: _space_figures([recording for recording in recordings if recording["space"] == space], powers)
            for space in sorted({recording["space"] for recording in recordings})
        },
        steady_error=_pooled_steady_error([report["steady"] for report in reports if report["steady"]["windows"]]),
        energy_unaccounted=max(report["energy"]["unaccounted_share"] for report in reports),
    )


def _space_figures(recordings: list[dict[str, Any]], powers: dict[str, Floats]) -> dict[str, float]:
    seconds = [recording["seconds"] for recording in recordings]
    hidden = [recording["hidden_W"]["rms"] ** 2 for recording in recordings]
    metered = np.concatenate([powers[recording["log"]] for recording in recordings])
    return {
        "recordings": len(recordings),
        "hours": sum(seconds) / 3600,
        "mean_W": float(np.nanmean(metered)),
        "p99_W": float(np.nanpercentile(metered, 99)),
        "max_W": float(np.nanmax(metered)),
        "hidden_rms_W": float(np.sqrt(np.average(hidden, weights=seconds))),
    }


def _pooled_steady_error(parts: list[dict[str, float]]) -> dict[str, float]:
    """Steady errors of all sessions together; empty where no session has a steady second."""
    if not parts:
        return {}
    windows = [part["windows"] for part in parts]
    return {
        "windows": sum(windows),
        "window_rms": float(np.sqrt(np.average([part["window_rms"] ** 2 for part in parts], weights=windows))),
        "window_worst": max(part["window_worst"] for part in parts),
        "second_worst": max(part["second_worst"] for part in parts),
    }
