"""Rows of a session on their way to SQL: first a file of JSON lines, then batches of inserts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

import sqlalchemy as sa

from acqd.errors import InputError, OperationError
from acqd.metering import WindowBatch
from acqd.storage.received import Received
from acqd.storage.schema import power
from acqd.storage.writer import Writer
from acqd.telemetry import topics
from acqd.telemetry.row import parse_row, rows_of

_BATCH = 20_000


class RowFile:
    """Rows as JSON lines, identical to the daemon's messages."""

    def __init__(self, path: Path, device: str, boot: str) -> None:
        self._path, self._part = path, path.with_name(f".{path.name}.{os.getpid()}")
        self._file: BinaryIO = self._part.open("wb", buffering=1 << 20)
        self._device, self._boot = device, boot

    def write(self, batch: WindowBatch) -> None:
        """Append the rows of a batch."""
        self._file.write(b"".join(row.to_json() + b"\n" for row in rows_of(batch, self._device, self._boot)))

    def close(self, *, complete: bool) -> None:
        """Rename the file to its final name if complete, else delete it."""
        self._file.close()
        if complete:
            self._part.replace(self._path)
        else:
            self._part.unlink()


def store_rows(path: Path, engine: sa.Engine) -> int:
    """Write a row file into the database and return its number of rows. Existing rows are kept.

    Raises InputError for a damaged file, OperationError when the database refuses the rows.
    """
    writer = Writer(engine)
    messages: list[Received] = []
    count = 0
    with path.open("rb") as file:
        for line in file:
            payload = line.rstrip(b"\n")
            try:
                row = parse_row(payload)
            except ValueError as error:
                raise InputError(path, f"line {count + 1}: {error}; remove it and run the same command again") from None
            messages.append(Received(topics.power(row.device, row.channel), payload))
            count += 1
            if len(messages) == _BATCH:
                _commit(writer, messages)
                messages = []
    _commit(writer, messages)
    return count


def rows_stored(engine: sa.Engine, device: str, boot: str) -> int:
    """Number of rows of one session in the database."""
    query = sa.select(sa.func.count()).where(power.c.device == device, power.c.boot == boot)
    with engine.connect() as connection:
        return int(connection.execute(query).scalar_one())


def _commit(writer: Writer, messages: list[Received]) -> None:
    try:
        writer.write(messages)
    except sa.exc.DatabaseError as error:
        reason = str(error.orig).strip().splitlines()[0] if error.orig else str(error)
        raise OperationError(
            f"the database refused the rows ({reason}); run the same command again to continue"
        ) from None
