"""The check of `acqd doctor` on the archive: whether its disk has the room that the configuration promises."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from acqd.daemon.config import Config
from acqd.daemon.finding import Finding

_GB_A_DAY = 12.0
"""Of a three-phase box at 20 kHz, at most: an upper figure of what docs/archive.md has measured."""


def archive_checks(config: Config) -> Iterator[Finding]:
    """Where samples are kept, how long they last, and what is kept for the rows."""
    if not config.archived:
        return
    section, place = config.archive, config.archive.place(config.state_dir, config.device)
    if place is None:
        yield Finding("archive", "fail", "nobody says where", "set [archive] folder, or state_dir")
        return
    above = next(each for each in (place.absolute(), *place.absolute().parents) if each.exists())
    if not os.access(above, os.W_OK):
        yield Finding("archive", "fail", f"{above} may not be written", "change its owner or [archive] folder")
        return
    there = sum(path.stat().st_size for path in place.glob("*/*.arc"))
    daily = _GB_A_DAY * len(config.archived)
    room = there / 1e9 + shutil.disk_usage(above).free / 1e9 - section.keep_free_gb
    lasts = min(section.max_days, min(room, section.max_gb) / daily)
    text = (
        f"{there / 1e9:.1f} of {section.max_gb:g} GB at {place}; {daily:.0f} GB a day at most: "
        f"{lasts:.1f} days, {section.keep_free_gb:g} GB are left to the rows"
    )
    if room < min(section.max_gb, section.max_days * daily):
        advice = f"the disk has room for {max(room, 0):.0f} GB of samples: the ring is shorter than [archive] says"
        yield Finding("archive", "warn", text, advice)
    elif section.keep_free_gb * 1000 < config.spool.max_mb and _same_disk(above, config.state_dir):
        advice = f"[archive] keep_free_gb below [spool] max_mb = {config.spool.max_mb:g}: a full spool would not fit"
        yield Finding("archive", "warn", text, advice)
    else:
        yield Finding("archive", "ok", text)


def _same_disk(folder: Path, state_dir: Path | None) -> bool:
    return state_dir is not None and state_dir.exists() and os.stat(folder).st_dev == state_dir.stat().st_dev
