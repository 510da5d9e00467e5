"""Blocks of the disk that are set aside: a stop writes into them what is in memory because the disk is full."""

from __future__ import annotations

import logging
import os
from pathlib import Path

_log = logging.getLogger(__name__)
_MODE = 0o640


class Reserve:
    """A file of blocks to which nothing is written until it becomes the file of a segment."""

    def __init__(self, path: Path, size: int) -> None:
        """`size`: of all blocks together [bytes]."""
        self.path, self._size = path, size
        self._said = False

    def keep(self) -> None:
        """Set the blocks aside again where a person has deleted the file, or the disk had no room for it before."""
        try:
            whole = self.path.stat().st_size >= self._size
        except OSError:
            whole = False
        if not whole:
            self.make()

    def make(self) -> None:
        """Have the disk set the blocks aside; a disk that has no room for all keeps its room for rows."""
        try:
            file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, _MODE)
            try:
                self._allocate(file)
            finally:
                os.close(file)
        except OSError as error:
            if not self._said:
                _log.warning("spool: the disk sets nothing aside for a stop while it is full (%s)", error.strerror)
            self._said = True
        else:
            self._said = False

    def _allocate(self, file: int) -> None:
        """Raises OSError and takes no blocks."""
        before = os.fstat(file).st_size
        try:
            os.posix_fallocate(file, 0, self._size)
        except OSError:
            os.ftruncate(file, before)
            raise
