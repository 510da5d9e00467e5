"""Reads one segment: what it says, where its chunks are, its blocks."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from acqd.archive.chunk import Chunk, Place, parse_chunk
from acqd.archive.head import Head, unpacked_state
from acqd.archive.record import CHUNK, END, HEAD, OVERHEAD, STATE, Record, record_at, records
from acqd.archive.segment_file import TRAILER
from acqd.errors import InputError
from acqd.metering.block import SampleBlock
from acqd.metering.run import Run

_HEAD_BYTES = 1 << 16


@dataclass(frozen=True, slots=True)
class Segment:
    """What is in a file."""

    path: Path
    head: Head
    chunks: tuple[Place, ...]
    why: str | None
    """Why it ended; None: nobody has said so yet, it is being written or acqd was killed."""
    size: int
    """Bytes of the file."""
    damaged: int = 0
    """Bytes before the last unharmed record that are none."""
    torn: int = 0
    """Bytes after the last unharmed record."""

    @staticmethod
    def open(path: Path) -> Segment:
        """By its index, or record by record where it has none. Raises InputError, OSError."""
        with path.open("rb", buffering=0) as file:
            size = os.fstat(file.fileno()).st_size
            front = os.pread(file.fileno(), _HEAD_BYTES, 0)
            head = _head(path, front)
            ended = _end(file.fileno(), size)
            if ended is not None:
                chunks, why = ended
                return Segment(path, head, chunks, why, size)
            data = file.read()
        return _scanned(path, head, data)

    @property
    def samples(self) -> int:
        """In the file."""
        return sum(place.samples for place in self.chunks)

    @property
    def seconds(self) -> float:
        """Of samples."""
        return self.samples / self.head.origin.form.rate

    @property
    def begin_ns(self) -> int:
        """UTC of the first sample."""
        return self.head.utc_ns

    @property
    def end_ns(self) -> int:
        """UTC of the end of the last sample."""
        return self.chunks[-1].end_ns if self.chunks else self.head.utc_ns

    @property
    def end(self) -> int:
        """Number after the last sample."""
        return self.chunks[-1].first + self.chunks[-1].samples if self.chunks else self.head.index

    def touches(self, begin_ns: int | None, end_ns: int | None) -> bool:
        """Whether samples of it may lie in begin .. end; None: no bound."""
        low = min((self.begin_ns, *(place.utc_ns for place in self.chunks)))
        high = max((self.end_ns, *(place.end_ns for place in self.chunks)))
        return (end_ns is None or low < end_ns) and (begin_ns is None or high > begin_ns)

    def state(self) -> dict[str, Any]:
        """Of the meter at the first sample. Raises InputError, OSError."""
        with self.path.open("rb") as file:
            data = file.read(self.chunks[0].offset if self.chunks else self.size)
        first = record_at(data, 0)
        found = None if first is None else record_at(data, first.end)
        if found is None or found.kind != STATE:
            raise InputError(self.path, "has no state of the meter: rows of its samples cannot be made again")
        try:
            return unpacked_state(bytes(found.body))
        except ValueError as error:
            raise InputError(self.path, str(error)) from None

    def harmed_before(self, k: int) -> bool:
        """Whether records between chunk `k` and the one before it were damaged."""
        return self.chunks[k].number != (self.chunks[k - 1].number + 1 if k else 0)

    def blocks(
        self, begin_ns: int | None = None, end_ns: int | None = None, *, skip: bool = False
    ) -> Iterator[SampleBlock]:
        """The blocks of all chunks that touch begin .. end.

        Raises InputError where a chunk is damaged, unless `skip`; OSError.
        """
        for run in self.runs(begin_ns, end_ns, skip=skip):
            yield from run.blocks(self.head.origin.form.rate)

    def runs(self, begin_ns: int | None = None, end_ns: int | None = None, *, skip: bool = False) -> Iterator[Run]:
        """The same, blocks that follow each other as one."""
        form = self.head.origin.form
        with self.path.open("rb", buffering=0) as file:
            for k, place in enumerate(self.chunks):
                late = end_ns is not None and place.utc_ns >= end_ns
                if late or (begin_ns is not None and place.end_ns <= begin_ns):
                    continue
                try:
                    if self.harmed_before(k) and not skip:
                        raise ValueError("records before this one are damaged")
                    runs = _chunk(file.fileno(), place, self).samples(form)
                except ValueError as error:
                    if skip:
                        continue
                    raise InputError(self.path, f"at byte {place.offset}: {error}") from None
                yield from runs


def _chunk(file: int, place: Place, segment: Segment) -> Chunk:
    """Raises ValueError, OSError."""
    frame = os.pread(file, OVERHEAD, place.offset)
    length = int.from_bytes(frame[5:9], "little") if len(frame) == OVERHEAD else 0
    found = record_at(frame + os.pread(file, length, place.offset + OVERHEAD), 0)
    if found is None or found.kind != CHUNK:
        raise ValueError("the checksum is wrong: its samples are damaged")
    return parse_chunk(found.body, segment.head.origin.form)


def _head(path: Path, front: bytes) -> Head:
    found = record_at(front, 0)
    if found is None or found.kind != HEAD:
        raise InputError(path, "does not begin like a segment of an archive of acqd, or its beginning is damaged")
    try:
        return Head.parse(bytes(found.body))
    except ValueError as error:
        raise InputError(path, str(error)) from None


def _end(file: int, size: int) -> tuple[tuple[Place, ...], str] | None:
    """Index and reason at the end of a file; None where it has none."""
    if size < TRAILER.size:
        return None
    (offset,) = TRAILER.unpack(os.pread(file, TRAILER.size, size - TRAILER.size))
    if not 0 < offset < size:
        return None
    found = record_at(os.pread(file, size - TRAILER.size - offset, offset), 0)
    if found is None or found.kind != END or offset + found.end != size - TRAILER.size:
        return None
    try:
        told = orjson.loads(found.body)
        return tuple(Place(*place) for place in told["chunks"]), str(told["why"])
    except (ValueError, KeyError, TypeError):
        return None


def _scanned(path: Path, head: Head, data: bytes) -> Segment:
    """A segment without an index."""
    chunks, intact, last = list[Place](), 0, 0
    for found in records(data):
        if found.kind == CHUNK and (place := _place(found, head)) is not None:
            chunks.append(place)
        intact, last = intact + found.end - found.offset, found.end
    return Segment(path, head, tuple(chunks), None, len(data), last - intact, len(data) - last)


def _place(found: Record, head: Head) -> Place | None:
    form = head.origin.form
    try:
        return parse_chunk(found.body, form).place(found.offset, form.rate)
    except ValueError:
        return None
