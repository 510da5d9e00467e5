"""Rows of a session on their way to SQL: a file beside the campaign, then one transaction."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import sqlalchemy as sa

from acqd.errors import OperationError
from acqd.metering import WindowBatch
from acqd.storage.writer import Received, Writer
from acqd.telemetry import topics
from acqd.telemetry.row import parse_row, rows_of

_BATCH = 20_000


class RowFile:
    """Rows as JSON lines, exactly as the daemon would publish them."""

    def __init__(self, path: Path, device: str, boot: str) -> None:
        self._file: BinaryIO = path.open("wb", buffering=1 << 20)
        self._device, self._boot = device, boot

    def write(self, batch: WindowBatch) -> None:
        """Append the rows of a batch."""
        self._file.write(b"".join(row.to_json() + b"\n" for row in rows_of(batch, self._device, self._boot)))

    def close(self) -> None:
        """Flush and close."""
        self._file.close()


def store_rows(path: Path, engine: sa.Engine) -> int:
    """Write a row file into the database; rows that are there already are left alone. Returns their number."""
    writer = Writer(engine)
    messages: list[Received] = []
    count = 0
    with path.open("rb") as file:
        for line in file:
            payload = line.rstrip(b"\n")
            row = parse_row(payload)
            messages.append(Received(topics.power(row.device, row.channel), payload))
            count += 1
            if len(messages) == _BATCH:
                _commit(writer, messages)
                messages = []
    _commit(writer, messages)
    return count


def _commit(writer: Writer, messages: list[Received]) -> None:
    try:
        writer.write(messages)
    except sa.exc.DatabaseError as error:
        reason = str(error.orig).strip().splitlines()[0] if error.orig else str(error)
        raise OperationError(f"the database refused the rows ({reason}); run the same command again to go on") from None
