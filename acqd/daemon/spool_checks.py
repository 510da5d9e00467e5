"""The checks of `acqd doctor` on the spool; they look and write nothing."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from acqd.daemon.config import Config
from acqd.daemon.finding import Finding
from acqd.telemetry.spool.left_behind import folder_of, left_behind, strangers


def spool_checks(config: Config) -> Iterator[Finding]:
    """Where rows wait, and whether the disk has room for as many as the configuration allows."""
    if not config.mqtt.enabled:
        return
    if config.state_dir is None:
        advice = "set state_dir: rows then survive a restart, and hours without a broker"
        yield Finding("spool", "warn", "no state_dir: rows wait in memory, at most 32 MB", advice)
        return
    folder = _existing(config.state_dir)
    there = sum(path.stat().st_size for path in folder_of(config.state_dir, config.device).glob("*.seg"))
    free, needed = shutil.disk_usage(folder).free, config.spool.max_mb * 1e6 - there
    text = f"{there / 1e6:.0f} of {config.spool.max_mb:g} MB, until {config.spool.until}"
    mine = folder_of(config.state_dir, config.device)
    if left := left_behind(config.state_dir, config.device) or strangers(mine):
        yield Finding("spool", "warn", left.what, left.remedy)
    if free < needed:
        advice = f"{free / 1e6:.0f} MB are free at {folder}: make room or lower [spool] max_mb"
        yield Finding("spool", "warn", text, advice)
    else:
        yield Finding("spool", "ok", text)


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that exists."""
    return next(place for place in (folder.absolute(), *folder.absolute().parents) if place.exists())
