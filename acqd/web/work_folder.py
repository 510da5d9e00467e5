"""The hidden folder in which the page works; what a page that was killed has left is removed, what runs is not."""

from __future__ import annotations

import fcntl
import os
import shutil
import time
from pathlib import Path

from acqd.errors import UserError


class WorkFolder:
    """A new folder below [web] reports, locked until it is kept or removed, or its page has ended."""

    def __init__(self, reports: Path) -> None:
        """Raises UserError when the folder cannot be made."""
        now = time.time()
        try:
            while True:
                self.name = time.strftime("files-%Y%m%dT%H%M%SZ", time.gmtime(now))
                self.path = reports / f".{self.name}"
                if not (reports / self.name).exists() and (lock := _made(self.path)) is not None:
                    break
                now += 1.0  # of another visit within this second
        except OSError as error:
            raise UserError(f"{reports} cannot be written ({error.strerror}); see [web] reports") from None
        self._lock = lock

    def keep(self) -> None:
        """Show the folder. Raises OSError."""
        self.path.rename(self.path.with_name(self.name))
        os.close(self._lock)

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self.path, ignore_errors=True)
        os.close(self._lock)


def remove_left(reports: Path) -> None:
    """Remove folders of pages that have ended."""
    for left in reports.glob(".files-*"):
        lock = _locked(left)
        if lock is not None:
            shutil.rmtree(left, ignore_errors=True)
            os.close(lock)


def _made(path: Path) -> int | None:
    """The lock of a new folder; None where it is there already. Raises OSError."""
    try:
        path.mkdir(parents=True)
    except FileExistsError:
        return None
    return _locked(path)


def _locked(path: Path) -> int | None:
    """A descriptor that locks a folder; None when another process has it, or it is gone."""
    try:
        lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return None
    return lock
