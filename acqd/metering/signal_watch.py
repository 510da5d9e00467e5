"""The samples of a running stream, looked at a few times a second: are they measurements?

A stage before the meter, which leaves the samples as they are and adds flags to blocks. What an examination finds holds
until the next. Between two of them, extremes are counted: a channel that stays at its extremes for longer than at the
last one, or comes near both ends of 16 bits, is examined at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.block import Codes, SampleBlock, StreamFormat
from acqd.metering.integrity import flags_of
from acqd.metering.look import Look, Looker
from acqd.metering.packed import State
from acqd.metering.run import Run

_EVERY_S = 0.4
"""Between two looks."""
_LONGER, _FEW = 2.0, 4
"""Times the samples at the extremes of a channel at the last look, and so many more: it may be clipped."""
_FORGET = 0.7
"""What is left of that after a block: loads that switch on and off are no reason for a look each time."""
_END = 30_000
"""Codes of 16 bits that roll over come near both ends."""


class SignalWatch:
    """Flags blocks of one stream `clipped`, `rollover`, `offset`, `saturated`."""

    def __init__(self, form: StreamFormat) -> None:
        self.form = form
        self._cycle = round(form.rate / form.f_nominal)
        self._looker = Looker(len(form.scale), self._cycle)
        self._usual = np.array([_LONGER, _FORGET, _FEW, _END if form.bits == 16 else np.inf])
        self._every = round(_EVERY_S * form.rate)
        self._next = 0
        self._flags: frozenset[str] = frozenset()
        self._pause = self._every  # samples to the next look at a fault
        # share of the samples at the extremes of each channel that is no reason to look; None before the first look
        self._most: Floats | None = None
        self._pair = np.zeros(2, dtype=np.int64)  # edges of one block

    def state(self) -> State:
        """When the next look is due, what the newest has found, and what is usual."""
        most = [] if self._most is None else self._most.tolist()
        return {"next": self._next, "flags": sorted(self._flags), "pause": self._pause, "most": most}

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._next, self._flags = int(state["next"]), frozenset(state["flags"])
        self._pause = int(state.get("pause", self._every))
        most = [float(share) for share in state.get("most", [])]
        self._most = np.array(most) if most else None

    def apply(self, block: SampleBlock) -> SampleBlock:
        """The block, with what was found in it, or holds since the newest look before it."""
        self._pair[1] = len(block.codes)
        (flags,) = self._of_blocks(block, self._pair)
        return replace(block, flags=block.flags | flags) if flags else block

    def apply_run(self, run: Run) -> Iterator[SampleBlock]:
        """What `apply` makes of each block of a run; all of them as one where nothing is found."""
        flags = self._of_blocks(run.block, np.array(run.edges))
        if not any(flags):
            yield run.block
            return
        for block, named in zip(run.blocks(self.form.rate), flags, strict=True):
            yield replace(block, flags=block.flags | named) if named else block

    def _of_blocks(self, block: SampleBlock, edges: NDArray[np.int64]) -> list[frozenset[str]]:
        """Flags of each of the blocks that have been joined as `block`, cut at `edges`."""
        if block.lost:
            self._next = block.index
        found, blocks = list[frozenset[str]](), len(edges) - 1
        while len(found) < blocks:
            if not self._flags and self._most is not None:
                due = self._next - block.index
                rest = edges[len(found) :] if found else edges
                calm = self._looker.calm(block.codes, rest, due, self._usual, self._most)
                found += [self._flags] * calm
            if len(found) < blocks:
                begin, end = edges[len(found) : len(found) + 2].tolist()
                found.append(self._of_block(block.codes[begin:end], block.index + begin))
        return found

    def _of_block(self, codes: Codes, index: int) -> frozenset[str]:
        """Flags of a block [samples, channels] that begins with sample `index`."""
        if len(codes) < self._cycle:
            return self._flags
        flags, size = frozenset[str](), 2 * self._cycle
        for at in range(0, len(codes) - self._cycle + 1, size):
            # The last stretch takes the rest of the block.
            end = at + size if len(codes) - at - size >= self._cycle else len(codes)
            self._examine(codes[at:end], index + at)
            flags |= self._flags
        return flags

    def _examine(self, codes: Codes, index: int) -> None:
        """Look at some cycles [samples, channels] where a look is due, or where they stand out."""
        due, faulty = index >= self._next, bool(self._flags)
        if faulty and not due:
            return
        look, samples = self._looker.at(codes), len(codes)
        ends = zip(look.least, look.most, look.at_least, look.at_most, strict=True)
        shares = np.array([((low + high) if least < most else low) / samples for least, most, low, high in ends])
        if due or self._stands_out(shares, look, samples):
            self._flags = flags_of(codes, self._cycle, look)
            if "clipped" not in self._flags and self._looker.blurred(codes, look):
                self._flags |= {"clipped"}
            # A fault is looked at again after twice the time: it is flagged for at most twice as long as it lasts.
            self._pause = min(2 * self._pause, self._every) if faulty else samples
            self._next = index + (self._pause if self._flags else self._every)
        if not self._flags:
            self._most = np.maximum(_LONGER * shares, 0.0 if self._most is None else _FORGET * self._most)

    def _stands_out(self, shares: Floats, look: Look, samples: int) -> bool:
        """Whether a fault may have come since the last look."""
        if self._most is None or (shares > self._most + _FEW / samples).any():
            return True
        ends = zip(look.most, look.least, strict=True)
        return self.form.bits == 16 and any(most > _END and least < -_END for most, least in ends)
