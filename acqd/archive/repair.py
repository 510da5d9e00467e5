"""Ends segments that acqd could not end: a kill, a crash and a power failure leave a torn record, and no index."""

from __future__ import annotations

import logging
import os
from pathlib import Path

from acqd.archive.segment import Segment
from acqd.archive.segment_file import DAMAGED, TORN, end_of
from acqd.errors import InputError

_log = logging.getLogger(__name__)


def repair(path: Path) -> Segment | None:
    """The segment in a file that nobody writes to, with its end; None where no segment begins there.

    What follows the last whole record was being written and is cut off. A file without a beginning keeps all its bytes
    and is put aside. Raises OSError.
    """
    try:
        segment = Segment.open(path)
    except InputError as error:
        path.rename(path.with_suffix(DAMAGED))
        _log.warning("archive: %s; it is kept as %s", error, path.with_suffix(DAMAGED).name)
        return None
    if segment.why is not None:
        return segment
    whole = segment.size - segment.torn
    file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CLOEXEC)
    try:
        os.ftruncate(file, whole)
        os.write(file, end_of(segment.chunks, TORN, whole))
        os.fsync(file)
    finally:
        os.close(file)
    _log.warning(
        "archive: %s had no end: acqd was killed, or the power failed; %d chunks are whole, %d torn bytes were cut",
        path.name, len(segment.chunks), segment.torn,
    )  # fmt: skip
    return Segment.open(path)
