"""Segments whose rows are delivered, kept for a while: a sink whose database is put back wants them again (ADR 29).

Then they are deleted. Where the disk does not let them go, that is tried again: their rows would be sent once more
after the next start, and their bytes would stay.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from contextlib import suppress
from pathlib import Path

from acqd.telemetry.spool.segment import KEPT, SUFFIX, Segment

_log = logging.getLogger(__name__)
_RETRY_S = 1.0


class KeptSegments:
    """In the order in which they were delivered; of one folder, for one thread."""

    def __init__(self, keep_s: float) -> None:
        """0: none is kept."""
        self._keep_s = keep_s
        self._segments: deque[tuple[float, Segment]] = deque()
        self.bytes = 0
        self._undeleted: list[Segment] = []
        self._retry_at = 0.0

    def add(self, segment: Segment) -> bool:
        """Keep a delivered segment; False where it is to be deleted instead."""
        if not self._keep_s or segment.path is None:
            return False
        with suppress(OSError):  # under the name that it has, the next start sends it again
            segment.rename(KEPT)
        self._append(segment)
        return True

    def adopt(self, path: Path, number: int) -> None:
        """A file that an earlier start has kept: its time begins again."""
        segment = Segment(number, path)
        with suppress(OSError):
            segment = Segment.open(path)
        self._append(segment)

    def expire(self, most_bytes: int) -> None:
        """Delete those that are past their time, and the oldest while all together are larger than `most_bytes`."""
        now = time.monotonic()
        if self._undeleted and now >= self._retry_at:
            self._retry_at = now + _RETRY_S
            self._undeleted = [segment for segment in self._undeleted if _refusal(segment)]
        while self._segments and (now - self._segments[0][0] >= self._keep_s or self.bytes > most_bytes):
            self._delete_oldest()

    def delete(self, segment: Segment) -> None:
        """Delete a segment, kept or not, now or as soon as the disk lets it go."""
        if why := _refusal(segment):
            _log.error("spool: %s cannot be deleted: %s; trying again", segment.path, why)
            self._undeleted.append(segment)

    def clear(self) -> None:
        """Delete all: the disk is full."""
        while self._segments:
            self._delete_oldest()

    def take_back(self) -> list[Segment]:
        """All: they are no kept segments any more."""
        taken = []
        for _, segment in self._segments:
            try:
                segment.rename(SUFFIX)
            except FileNotFoundError:
                continue  # a person has deleted it
            except OSError as error:
                _log.error("spool: %s cannot be renamed: %s; its rows wait all the same", segment.path, error.strerror)
            taken.append(segment)
        self._segments.clear()
        self.bytes = 0
        return taken

    def _append(self, segment: Segment) -> None:
        self._segments.append((time.monotonic(), segment))
        self.bytes += segment.size

    def _delete_oldest(self) -> None:
        _, segment = self._segments.popleft()
        self.bytes -= segment.size
        self.delete(segment)


def _refusal(segment: Segment) -> str:
    """Delete a segment; why the disk does not let it go, else empty."""
    try:
        segment.delete()
    except OSError as error:
        return error.strerror or str(error)
    return ""
