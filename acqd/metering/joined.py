"""Blocks that follow each other as longer ones: a call for a window takes several times what the window takes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from acqd.errors import InputError
from acqd.metering.block import SampleBlock


def joined(blocks: Iterable[SampleBlock], samples: int) -> Iterator[SampleBlock]:
    """The same samples in blocks of about so many; a meter that is `indifferent` makes the same rows of them.

    Passes on an InputError of `blocks`, after the samples before it.
    """
    waiting, count = list[SampleBlock](), 0
    try:
        for block in blocks:
            if waiting and not (_goes_on(waiting[-1], block) and count < samples):
                yield _one(waiting)
                waiting, count = [], 0
            waiting.append(block)
            count += len(block.codes)
    except InputError:
        if waiting:
            yield _one(waiting)
        raise
    if waiting:
        yield _one(waiting)


def _goes_on(before: SampleBlock, block: SampleBlock) -> bool:
    follows = block.index == before.index + len(before.codes) and not block.lost
    return follows and block.flags == before.flags and "clock_step" not in block.flags


def _one(blocks: list[SampleBlock]) -> SampleBlock:
    return blocks[0] if len(blocks) == 1 else replace(blocks[0], codes=np.concatenate([one.codes for one in blocks]))
