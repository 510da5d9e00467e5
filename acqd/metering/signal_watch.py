"""The samples of a running stream, looked at a few times a second: are they measurements?

A stage before the meter, which leaves the samples as they are and adds flags to blocks. What an examination finds holds
until the next. Between two of them, extremes are counted: a channel that stays at its extremes for longer than at the
last one, or comes near both ends of 16 bits, is examined at once.
"""

from __future__ import annotations

from dataclasses import replace

from acqd.metering.block import Codes, SampleBlock, StreamFormat
from acqd.metering.integrity import flags_of
from acqd.metering.look import Look, Looker
from acqd.metering.packed import State

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
        self._every = round(_EVERY_S * form.rate)
        self._next = 0
        self._flags: frozenset[str] = frozenset()
        self._pause = self._every  # samples to the next look at a fault
        self._most: list[float] = []  # share of the samples at the extremes of each channel that is no reason to look

    def state(self) -> State:
        """When the next look is due, what the newest has found, and what is usual."""
        return {"next": self._next, "flags": sorted(self._flags), "pause": self._pause, "most": self._most}

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._next, self._flags = int(state["next"]), frozenset(state["flags"])
        self._pause = int(state.get("pause", self._every))
        self._most = [float(share) for share in state.get("most", [])]

    def apply(self, block: SampleBlock) -> SampleBlock:
        """The block, with what was found in it, or holds since the newest look before it."""
        if block.lost:
            self._next = block.index
        flags, size, codes = self._flags, 2 * self._cycle, block.codes
        if len(codes) >= self._cycle:
            flags = frozenset()
            for at in range(0, max(len(codes) - self._cycle, 0) + 1, size):
                # The last stretch takes the rest of the block.
                end = at + size if len(codes) - at - size >= self._cycle else len(codes)
                self._examine(codes[at:end], block.index + at)
                flags |= self._flags
        return replace(block, flags=block.flags | flags) if flags else block

    def _examine(self, codes: Codes, index: int) -> None:
        """Look at some cycles [samples, channels] where a look is due, or where they stand out."""
        due, faulty = index >= self._next, bool(self._flags)
        if faulty and not due:
            return
        look, samples = self._looker.at(codes), len(codes)
        ends = zip(look.least, look.most, look.at_least, look.at_most, strict=True)
        shares = [((low + high) if least < most else low) / samples for least, most, low, high in ends]
        if due or self._stands_out(shares, look, samples):
            self._flags = flags_of(codes, self._cycle, look)
            # A fault is looked at again after twice the time: it is flagged for at most twice as long as it lasts.
            self._pause = min(2 * self._pause, self._every) if faulty else samples
            self._next = index + (self._pause if self._flags else self._every)
        if not self._flags:
            known = self._most or [0.0] * len(shares)
            self._most = [  # `max`, without calls: this is done for every block
                _LONGER * now if _LONGER * now > _FORGET * usual else _FORGET * usual
                for now, usual in zip(shares, known, strict=True)
            ]

    def _stands_out(self, shares: list[float], look: Look, samples: int) -> bool:
        """Whether a fault may have come since the last look."""
        if not self._most:
            return True
        slack = _FEW / samples
        for now, usual in zip(shares, self._most, strict=True):
            if now > usual + slack:
                return True
        if self.form.bits != 16 or max(look.most) <= _END:
            return False
        return any(most > _END and least < -_END for most, least in zip(look.most, look.least, strict=True))
