"""The files of an archive as a ring: the oldest make room for the newest, and all of them for the rows.

A segment is deleted because a limit in bytes, in seconds of samples or in free space says so, and for no other reason.
Seconds are counted in samples, and order is that of the running numbers: a clock that is set deletes nothing (ADR 29).
"""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import shutil
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

from acqd.archive.repair import repair
from acqd.archive.segment import Segment
from acqd.archive.segment_file import DAMAGED, SUFFIX, number_of
from acqd.changes import StateLog
from acqd.errors import InputError
from acqd.retry import Backoff, RetryPolicy

_log = logging.getLogger(__name__)
_VAIN = 3
"""Deletions that may free nothing at once: a reader may have the oldest files open."""
_PAUSES = RetryPolicy(first_s=30.0, longest_s=86_400.0)


@dataclass(frozen=True, slots=True)
class Limits:
    """Of an archive."""

    most_bytes: int
    most_s: float
    """Of samples, for each device."""
    keep_free: int
    """Bytes of the disk that the archive leaves to others: rows come first."""


@dataclass(slots=True)
class _File:
    number: int
    path: Path
    size: int
    seconds: float
    writing: bool = False


class Ring:
    """The files below a folder, one folder for each device. For one thread."""

    def __init__(self, root: Path, limits: Limits) -> None:
        self._root, self._limits = root, limits
        self._files: list[_File] = []
        self._says = StateLog(_log)
        self._vain, self._again_at = 0, 0.0
        """Deletions that freed nothing, one after another."""
        self._pauses = Backoff(_PAUSES)
        self.deleted = 0
        """Segments since the start."""

    def open(self) -> None:
        """Look what is there, and end what has no end. Raises OSError."""
        self._files = []
        for path in sorted(self._root.glob(f"*/*{SUFFIX}")) + sorted(self._root.glob(f"*/*{DAMAGED}")):
            number = number_of(path)
            if number is None:
                continue  # somebody else's file
            seconds = 0.0
            if path.suffix == SUFFIX:
                segment = self._repaired(path)
                seconds = segment.seconds if segment is not None else 0.0
                path = path if path.exists() else path.with_suffix(DAMAGED)
            self._files.append(_File(number, path, path.stat().st_size, seconds))
        self._files.sort(key=lambda file: file.number)

    @property
    def next_number(self) -> int:
        """Larger than that of any file, also of those that cannot be read."""
        return 1 + max((file.number for file in self._files), default=0)

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(file.size for file in self._files)

    @property
    def files(self) -> int:
        """How many there are."""
        return len(self._files)

    @property
    def seconds(self) -> float:
        """Of samples of the device that has most."""
        return max(self._seconds().values(), default=0.0)

    def add(self, number: int, path: Path) -> None:
        """A file that is being written from now on."""
        self._files.append(_File(number, path, 0, 0.0, writing=True))

    def update(self, number: int, size: int, seconds: float, *, writing: bool = True) -> None:
        """A file has grown, or is complete."""
        for file in reversed(self._files):
            if file.number == number:
                file.size, file.seconds, file.writing = size, seconds, writing
                return

    def make_room(self, more: int) -> None:
        """Delete the oldest segments until `more` bytes keep within the limits.

        Raises OSError where nothing is left to delete, or to delete does not help.
        """
        limits = self._limits
        while self.size + more > limits.most_bytes and self._delete(None):
            pass
        while (free := shutil.disk_usage(self._root).free) < limits.keep_free + more:
            if not self.give_up_oldest():
                vain = "; deleting segments frees nothing: snapshots, hard links?" if self._vain >= _VAIN else ""
                raise OSError(
                    errno.ENOSPC,
                    f"{free / 1e9:.2f} GB are free, and {limits.keep_free / 1e9:.2f} GB are kept for the rows{vain}",
                )

    def expire(self) -> None:
        """Delete what is more than the limit in seconds."""
        for device, seconds in self._seconds().items():
            while seconds > self._limits.most_s and (gone := self._delete(device)) is not None:
                seconds -= gone.seconds

    def give_up_oldest(self) -> bool:
        """Delete one segment because the disk is full; False where none is left, or where that frees nothing.

        Snapshots and hard links keep what is deleted: the whole archive would go for nothing. The pauses between
        attempts grow to a day.
        """
        if self._vain >= _VAIN and time.monotonic() < self._again_at:
            return False
        before = shutil.disk_usage(self._root).free
        gone = self._delete(None)
        if gone is None:
            return False
        if shutil.disk_usage(self._root).free - before >= gone.size / 2:
            self._vain = 0
            self._pauses.reset()
            return True
        self._vain += 1
        if self._vain >= _VAIN:
            self._again_at = time.monotonic() + self._pauses.pause_s()
        return True

    def _delete(self, device: str | None) -> _File | None:
        """The oldest file of a device, or of all, that nobody writes to."""
        for file in self._files:
            if file.writing or (device is not None and file.path.parent.name != device):
                continue
            try:
                file.path.unlink(missing_ok=True)
            except OSError as error:
                self._says.trouble("archive", "delete", f"{file.path} cannot be deleted ({error.strerror})")
                continue
            self._files.remove(file)
            self.deleted += 1
            return file
        return None

    def _seconds(self) -> dict[str, float]:
        seconds: dict[str, float] = defaultdict(float)
        for file in self._files:
            seconds[file.path.parent.name] += file.seconds
        return seconds

    @staticmethod
    def _repaired(path: Path) -> Segment | None:
        """A file that cannot be read now stays, and is looked at again at the next start."""
        try:
            return repair(path)
        except (OSError, InputError, ValueError) as error:
            _log.error("archive: %s cannot be read or ended (%s); it stays as it is", path, error)
            return None


def lock(root: Path) -> int:
    """The descriptor that holds the folder for this process. Raises OSError; BlockingIOError: another one has it."""
    root.mkdir(mode=0o750, parents=True, exist_ok=True)
    handle = os.open(root / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise
    return handle
