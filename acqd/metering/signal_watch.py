"""The samples of a running stream, looked at a few times a second: are they measurements?

A stage before the meter, which leaves the samples as they are and adds flags to blocks. A look at all channels takes as
long as dozens of windows in the kernel, so not every window gets one: what a look finds holds until the next.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.integrity import flags_of
from acqd.metering.packed import State

_EVERY_S = 0.4
"""Between two looks."""


class SignalWatch:
    """Flags blocks of one stream `clipped`, `rollover`, `offset`, `saturated`."""

    def __init__(self, form: StreamFormat) -> None:
        self.form = form
        self._cycle = round(form.rate / form.f_nominal)
        self._every = round(_EVERY_S * form.rate)
        self._next = 0
        self._flags: frozenset[str] = frozenset()

    def state(self) -> State:
        """When the next look is due, and what the newest has found."""
        return {"next": self._next, "flags": sorted(self._flags)}

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._next, self._flags = int(state["next"]), frozenset(state["flags"])

    def apply(self, block: SampleBlock) -> SampleBlock:
        """The block, with the flags of the newest look at a block with a whole cycle."""
        if (block.index >= self._next or block.lost) and len(block.codes) >= self._cycle:
            self._next = block.index + self._every
            newest = block.codes[-2 * self._cycle :]
            self._flags = flags_of(np.ascontiguousarray(newest, dtype=np.float64), self._cycle)
        return replace(block, flags=block.flags | self._flags) if self._flags else block
