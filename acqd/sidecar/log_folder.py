"""The folder of logs, into which strangers may write: opens plain files of a bounded size and follows no link."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO, TypeAlias

from acqd.errors import InputError

MOST_BYTES = 2 * 1024**3
"""Six hours of a log with 97 kB/s: twice what a controller writes that records 40 columns at 125 Hz."""

Mark: TypeAlias = tuple[int, int]
"""Size and modification time [ns] of a file's content."""


class LogFolder:
    """Opens files below one folder. The folder itself may be a link: the administrator named it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @contextmanager
    def open(self, path: Path) -> Iterator[BufferedReader]:
        """A plain file below the folder. Raises OSError (a link on the way, too), InputError for anything else.

        Each part of the path is opened below the one before, so that nobody can put a link in between meanwhile.
        """
        *parents, name = path.relative_to(self.folder).parts
        with ExitStack() as stack:
            place = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            stack.callback(os.close, place)
            for parent in parents:
                flags = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
                place = os.open(parent, flags, dir_fd=place)
                stack.callback(os.close, place)
            # O_NONBLOCK: opening a pipe must not wait for its writer
            number = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=place)
            file = stack.enter_context(os.fdopen(number, "rb"))
            if not stat.S_ISREG(os.fstat(number).st_mode):
                raise InputError(path.name, "is no plain file")
            yield file

    def identity(self, path: Path) -> tuple[str, Mark, str]:
        """SHA-256 of a file's content, its mark, and why the file is refused unread (empty if it is not).

        A file that is too large to be read has the hash of its path, size and time. Raises OSError, InputError.
        """
        with self.open(path) as file:
            mark = mark_of(file)
            if mark[0] <= MOST_BYTES:
                return hashlib.file_digest(file, "sha256").hexdigest(), mark, ""
        label = f"{path.relative_to(self.folder)}\0{mark[0]}\0{mark[1]}"
        reason = f"is {mark[0] / 1e9:.1f} GB; a log of at most {MOST_BYTES / 1e9:.1f} GB is expected"
        return hashlib.sha256(label.encode("utf-8", "surrogateescape")).hexdigest(), mark, reason


def mark_of(file: BinaryIO) -> Mark:
    """The mark of an open file."""
    status = os.fstat(file.fileno())
    return status.st_size, status.st_mtime_ns
