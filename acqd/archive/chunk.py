"""Consecutive blocks of samples as one record, with what each block said: number, UTC, losses, flags.

Blocks are kept as they were cut: their flags, and the last digits of what numpy meters, depend on it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import orjson

from acqd.archive.coding import decode, encode
from acqd.metering.block import SampleBlock, StreamFormat

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
    blocks: tuple[SampleBlock, ...]
    """With empty codes."""
    counts: tuple[int, ...]
    """Samples of each."""
    coding: str
    data: memoryview

    def samples(self, form: StreamFormat) -> list[SampleBlock]:
        """The blocks. Raises ValueError for data that is damaged."""
        codes = decode(self.coding, bytes(self.data), form.dtype, sum(self.counts), len(form.scale))
        edges = np.cumsum((0, *self.counts)).tolist()
        return [
            SampleBlock(codes[begin:end], block.index, block.utc_ns, block.lost, block.flags)
            for block, begin, end in zip(self.blocks, edges[:-1], edges[1:], strict=True)
        ]

    def place(self, offset: int, rate: float) -> Place:
        """Of the chunk whose record is at `offset`."""
        return place_of(self.number, offset, self.blocks, self.counts, rate)


def place_of(
    number: int, offset: int, blocks: Sequence[SampleBlock], counts: Sequence[int], rate: float
) -> Place:  # fmt: skip
    """Of a chunk of `blocks` with `counts` samples."""
    first = blocks[0]
    return Place(number, offset, first.index, first.utc_ns, sum(counts), after(blocks[-1], counts[-1], rate))


def after(block: SampleBlock, samples: int, rate: float) -> int:
    """UTC [ns] so many samples after the first one of `block`."""
    return block.utc_ns + round(samples * 1e9 / rate)


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
        blocks: list[SampleBlock] = []
        nothing = np.empty((0, len(form.scale)), form.dtype)
        counts = [_count(each[0]) for each in told["blocks"]]
        for k, (_, *rest) in enumerate(told["blocks"]):
            if rest:
                index, utc_ns, lost, flags = rest
                blocks.append(
                    SampleBlock(nothing, _count(index), int(utc_ns), _count(lost), frozenset(map(str, flags)))
                )
            else:
                before = blocks[-1]
                utc_ns = after(before, counts[k - 1], form.rate)
                blocks.append(SampleBlock(nothing, before.index + counts[k - 1], utc_ns, 0, before.flags))
        if not blocks:
            raise ValueError("it has no blocks")
        return Chunk(
            _count(told["number"]), tuple(blocks), tuple(counts), str(told["coding"]), body[_LENGTH.size + length :]
        )
    except (struct.error, KeyError, TypeError, IndexError) as error:
        raise ValueError(f"its blocks are told wrongly ({error!r})") from None


def _count(number: Any) -> int:
    if not isinstance(number, int) or number < 0:
        raise ValueError(f"{number!r} is no number of samples")
    return number


def _told(block: SampleBlock) -> list[Any]:
    return [len(block.codes), block.index, block.utc_ns, block.lost, sorted(block.flags)]


def _follows(block: SampleBlock, before: SampleBlock, form: StreamFormat) -> bool:
    count = len(before.codes)
    expected = (before.index + count, after(before, count, form.rate), 0, before.flags)
    return (block.index, block.utc_ns, block.lost, block.flags) == expected
