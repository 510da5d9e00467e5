"""For how many days the disk of the database has room: `acqd doctor` says it, and a sink at its start."""

from __future__ import annotations

import shutil
from pathlib import Path

from acqd.daemon.config import Config
from acqd.daemon.finding import Finding

_ROW_BYTES = 100
"""Of a row in SQLite with its index at most; `python -m tools.studies.row_layouts` measures it."""
_CHANNELS = 4
_WEEK_S = 7 * 86_400


def disk_check(config: Config, file: Path | None = None) -> Finding:
    """Room on the disk of the database for the devices of this configuration, a week and what is kept.

    `file`: of the database in use, where it is not the one of the configuration.
    """
    database = config.sink.database
    elsewhere = file is None and ("://" in database or "@" in database)
    folder = Path.cwd() if elsewhere else (file or Path(database)).absolute().parent
    try:
        free = shutil.disk_usage(folder).free
    except FileNotFoundError:
        return Finding("disk", "fail", f"{folder} does not exist", "create it")
    except OSError as error:  # a share that is away
        return Finding("disk", "fail", f"{folder}: {error.strerror or error}", "mount the disk or share")
    count = len(config.devices)
    week = _ROW_BYTES * _CHANNELS * count * _WEEK_S / config.window
    keep = config.sink.keep_days
    kept = f"keep_days = {keep:g}" if keep else "they stay for ever (keep_days = 0)"
    if keep is None and not elsewhere:
        kept = "they stay for 30 days, or for as long as there is room (no keep_days)"
    elif keep is None:
        kept = "they stay for 30 days (no keep_days)"
    devices = "1 device" if count == 1 else f"{count} devices"
    text = f"{free / 1e9:.1f} GB free at {folder}: rows of {devices} for {7 * free / week:.1f} days; {kept}"
    lasts = free > week and (elsewhere or free > week / 7 * (keep or 0))
    lower = "lower [sink] keep_days, or more disk" if keep else "more disk"
    advice = f"a week of rows needs {week / 1e9:.0f} GB, {week / 7e9:.1f} GB a day: {lower}"
    return Finding("disk", "ok", text) if lasts else Finding("disk", "warn", text, advice)
