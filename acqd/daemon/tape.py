"""A second record of all rows, written where they are made: what the database holds can be compared with it."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from pathlib import Path

from acqd.changes import StateLog
from acqd.errors import UserError
from acqd.telemetry.row import PowerRow, json_lines

_log = logging.getLogger(__name__)


class Tape:
    """Appends rows to a file of JSON lines, one system call per window: what is on it survives the daemon's death.

    A power failure may cost its end, and a full disk its rows: the tape is for campaigns and audits, not for delivery.
    """

    def __init__(self, path: Path) -> None:
        """Raises UserError when the file cannot be opened."""
        try:
            self._fd = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o640)
        except OSError as error:
            raise UserError(f"--tape {path}: cannot be written ({error.strerror}); choose another file") from None
        self._says = StateLog(_log)

    def write(self, rows: Sequence[PowerRow]) -> None:
        """Append rows, before they go anywhere else."""
        try:
            os.write(self._fd, json_lines(rows))
        except OSError as error:
            self._says.trouble("tape", "disk", f"cannot be written ({error.strerror}); its record has a hole")
        else:
            self._says.fine("tape", "is written again")
