"""Rows in spools of other names: a daemon that was renamed opens another folder, and nobody delivers the old one."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from acqd.telemetry.spool.segment import SUFFIX, Segment, number_of

_PREFIX = "spool-"


@dataclass(frozen=True, slots=True)
class LeftBehind:
    """Rows of another name, or why they are not known."""

    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.what}: {self.remedy}"


def folder_of(state_dir: Path, device: str) -> Path:
    """Where the daemon of this name keeps its rows."""
    return state_dir / f"{_PREFIX}{device}"


def left_behind(state_dir: Path, device: str) -> LeftBehind | None:
    """Rows that wait below `state_dir` in the spool of another name that no daemon has open; None: no such rows.

    Only reads. What cannot be read is named, too.
    """
    mine = folder_of(state_dir, device)
    try:
        entries = sorted(state_dir.iterdir()) if state_dir.exists() else []
    except OSError as error:
        return _unreadable(state_dir, error)
    others = [path for path in entries if path.name.startswith(_PREFIX) and path.is_dir() and path != mine]
    for folder in others:
        old = folder.name.removeprefix(_PREFIX)
        try:
            rows = 0 if _in_use(folder) else _waiting(folder)
        except OSError as error:
            return _unreadable(folder, error)
        if rows:
            return LeftBehind(
                f"{rows} rows of device {old} wait in {folder}, and nobody delivers them",
                f'was the device renamed? Start acqd with device = "{old}" until they are delivered, or delete it',
            )
    return None


def strangers(folder: Path) -> LeftBehind | None:
    """Files in the folder of a spool whose names are not those of segments, such as copies; None: no such files."""
    try:
        names = sorted(path.name for path in folder.iterdir() if path.suffix == SUFFIX and number_of(path) is None)
    except FileNotFoundError:
        return None  # it is made again with the next row
    except OSError as error:
        return _unreadable(folder, error)
    if not names:
        return None
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return LeftBehind(
        f"{folder / names[0]}{more} is no file of this spool, and nobody delivers what it holds",
        "delete a copy; a segment that was renamed gets its number back (sixteen digits) while acqd is stopped",
    )


def _unreadable(folder: Path, error: OSError) -> LeftBehind:
    return LeftBehind(
        f"whether rows of another name wait in {folder} cannot be read", f"{error.strerror}; check its rights"
    )


def _in_use(folder: Path) -> bool:
    """Whether a daemon has the spool open, by the kernel's list of locks (proc_locks(5)). Raises OSError.

    To try the lock could make a daemon fail that starts in the same moment.
    """
    try:
        inode = os.stat(folder / "lock").st_ino
    except FileNotFoundError:
        return False
    lines = [line.split() for line in Path("/proc/locks").read_text().splitlines()]
    return any("FLOCK" in words and any(word.endswith(f":{inode}") for word in words) for words in lines)


def _waiting(folder: Path) -> int:
    """Rows that are not delivered. Raises OSError."""
    files = [path for path in sorted(folder.iterdir()) if path.suffix == SUFFIX and number_of(path) is not None]
    return sum(len(rows) for path in files for rows in Segment.open(path).pending.values())
