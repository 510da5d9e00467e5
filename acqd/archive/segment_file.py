"""Writes one segment: head and state, chunks, and an index at its end."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import orjson

from acqd.archive.chunk import Place, chunk_body, place_of
from acqd.archive.head import Head, packed_state
from acqd.archive.record import CHUNK, END, HEAD, STATE, record
from acqd.metering.block import SampleBlock
from acqd.timestamps import rfc3339

SUFFIX, DAMAGED = ".arc", ".damaged"
"""Of a segment; of what cannot be read as one."""
_NAME = re.compile(r"(\d{9})-(\d{8}T\d{6}Z)\.(?:arc|damaged)")
_MODE = 0o640
TRAILER = struct.Struct("<Q")
"""The last bytes of a segment that was ended: where its record END is."""
STOPPED, FULL, TORN = "stop", "full", "torn"
"""Why a segment ends: acqd was stopped; it is long enough; acqd ended without a word and the end was written later."""


def name_of(number: int, utc_ns: int) -> str:
    """000000042-20261125T151200Z.arc: sorts by number, which no clock can turn round."""
    stamp = rfc3339(utc_ns)[:19].replace("-", "").replace(":", "")
    return f"{number:09d}-{stamp}Z{SUFFIX}"


def number_of(path: Path) -> int | None:
    """Number of the segment in a file; None for a file of another name."""
    named = _NAME.fullmatch(path.name)
    return int(named[1]) if named else None


def stamp_of(path: Path) -> int:
    """UTC [ns] of the first sample of a segment, cut to seconds, by the name of its file."""
    return round(datetime.strptime(path.stem[10:], "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC).timestamp()) * 10**9


def end_of(index: Sequence[Place], why: str, offset: int) -> bytes:
    """The record END, to be written at `offset`: places of all chunks, why there are no more; then its offset."""
    return record(END, orjson.dumps({"why": why, "chunks": [list(place) for place in index]})) + TRAILER.pack(offset)


class SegmentFile:
    """One open file. Whatever raises leaves what was written before."""

    def __init__(self, folder: Path, name: str, head: Head, state: dict[str, Any]) -> None:
        """Raises OSError."""
        folder.mkdir(mode=0o750, parents=True, exist_ok=True)
        self.path, self._form = folder / name, head.origin.form
        self.size, self._index, self._dirty = 0, list[Place](), True
        self.seconds = 0.0
        """Of samples."""
        self._file = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC, _MODE)
        try:
            self._write(record(HEAD, head.to_json()) + record(STATE, packed_state(state)))
        except OSError:
            os.close(self._file)
            with suppress(OSError):
                self.path.unlink()
            raise
        self._confirm_folder(folder)

    def append(self, blocks: Sequence[SampleBlock]) -> None:
        """Write blocks as one chunk. Raises OSError."""
        number = len(self._index)
        body = chunk_body(number, blocks, self._form)
        place = place_of(number, self.size, blocks, [len(block.codes) for block in blocks], self._form.rate)
        self._write(record(CHUNK, body))
        self._index.append(place)
        self.seconds += place.samples / self._form.rate

    def sync(self) -> None:
        """Wait until the disk has everything. Raises OSError."""
        if self._dirty:
            os.fdatasync(self._file)
            self._dirty = False

    def close(self, why: str) -> None:
        """Write the index, as far as the disk takes it; without one the file is read as a whole later."""
        with suppress(OSError):
            self._write(end_of(self._index, why, self.size))
            self.sync()
        with suppress(OSError):
            os.close(self._file)

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._file, view) :]
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._file, self.size)
            raise
        self.size += len(data)
        self._dirty = True

    @staticmethod
    def _confirm_folder(folder: Path) -> None:
        with suppress(OSError):  # the file is there; only a power failure could still take its name
            handle = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)
