"""Consecutive blocks of samples as one record, with what each block said: number, UTC, losses, flags.

Blocks are kept as they were cut: their flags, and the last digits of what numpy meters, depend on it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import orjson

from acqd.archive.coding import decode, encode
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.run import Run, after

_LENGTH = struct.Struct("<I")


class Place(NamedTuple):
    """Where a chunk is, and which samples are in it."""

    number: int
    """Of the chunk in its segment, from 0: where one is missing, bytes were damaged."""
    offset: int
    """Of its record in the file."""
    first: int
    """Number of its first sample in the stream."""
    utc_ns: int
    """Of its first sample."""
    samples: int
    """In it; none is missing between them."""
    end_ns: int
    """UTC of the end of its last sample."""


@dataclass(frozen=True, slots=True)
class Chunk:
    """Blocks that follow each other, without their samples."""

    number: int
    """In its segment."""
    runs: tuple[Run, ...]
    """All blocks, with empty codes."""
    coding: str
    data: memoryview

    def samples(self, form: StreamFormat) -> list[Run]:
        """The blocks. Raises ValueError for data that is damaged."""
        total = sum(run.edges[-1] for run in self.runs)
        codes = decode(self.coding, bytes(self.data), form.dtype, total, len(form.scale))
        ready, begin = list[Run](), 0
        for run in self.runs:
            end = begin + run.edges[-1]
            ready.append(Run(replace(run.block, codes=codes[begin:end]), run.edges))
            begin = end
        return ready

    def place(self, offset: int, rate: float) -> Place:
        """Of the chunk whose record is at `offset`."""
        blocks = [block for run in self.runs for block in run.blocks(rate)]
        counts = [end - begin for run in self.runs for begin, end in pairwise(run.edges)]
        return place_of(self.number, offset, blocks, counts, rate)


def place_of(
    number: int, offset: int, blocks: Sequence[SampleBlock], counts: Sequence[int], rate: float
) -> Place:  # fmt: skip
    """Of a chunk of `blocks` with `counts` samples."""
    first, last = blocks[0], blocks[-1]
    return Place(number, offset, first.index, first.utc_ns, sum(counts), after(last.utc_ns, counts[-1], rate))


def chunk_body(number: int, blocks: Sequence[SampleBlock], form: StreamFormat) -> bytes:
    """The content of the record: what is written of a block is only what does not follow from the one before."""
    coding, data = encode(np.concatenate([block.codes for block in blocks]))
    told, before = [], None
    for block in blocks:
        told.append([len(block.codes)] if before is not None and _follows(block, before, form) else _told(block))
        before = block
    text = orjson.dumps({"number": number, "coding": coding, "blocks": told})
    return _LENGTH.pack(len(text)) + text + data


def parse_chunk(body: memoryview, form: StreamFormat) -> Chunk:
    """Raises ValueError that says what is wrong."""
    try:
        (length,) = _LENGTH.unpack_from(body)
        told = orjson.loads(body[_LENGTH.size : _LENGTH.size + length])
        runs = tuple(_runs(told["blocks"], form))
        if not runs:
            raise ValueError("it has no blocks")
        return Chunk(_count(told["number"]), runs, str(told["coding"]), body[_LENGTH.size + length :])
    except (struct.error, KeyError, TypeError, IndexError) as error:
        raise ValueError(f"its blocks are told wrongly ({error!r})") from None


def _runs(told: list[list[Any]], form: StreamFormat) -> Iterator[Run]:
    """Runs of blocks of which only the first says more than how many samples it has."""
    nothing = np.empty((0, len(form.scale)), form.dtype)
    first: SampleBlock | None = None
    edges = [0]
    for count, *rest in told:
        if rest:
            if first is not None:
                yield Run(first, edges)
            index, utc_ns, lost, flags = rest
            first = SampleBlock(nothing, _count(index), int(utc_ns), _count(lost), frozenset(map(str, flags)))
            edges = [0]
        elif first is None:
            raise IndexError("the first one says no time")
        elif "clock_step" in first.flags:  # of which each one says what time it is
            yield Run(first, edges)
            first = replace(
                first, index=first.index + edges[-1], utc_ns=after(first.utc_ns, edges[-1], form.rate), lost=0
            )
            edges = [0]
        edges.append(edges[-1] + _count(count))
    if first is not None:
        yield Run(first, edges)


def _count(number: Any) -> int:
    if not isinstance(number, int) or number < 0:
        raise ValueError(f"{number!r} is no number of samples")
    return number


def _told(block: SampleBlock) -> list[Any]:
    return [len(block.codes), block.index, block.utc_ns, block.lost, sorted(block.flags)]


def _follows(block: SampleBlock, before: SampleBlock, form: StreamFormat) -> bool:
    count = len(before.codes)
    expected = (before.index + count, after(before.utc_ns, count, form.rate), 0, before.flags)
    return (block.index, block.utc_ns, block.lost, block.flags) == expected
