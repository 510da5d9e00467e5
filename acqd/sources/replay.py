"""Recorded waveforms as a source: recorded time kept, looped on request."""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate

import numpy as np

from acqd.metering import SampleBlock
from acqd.metering.block import Codes
from acqd.sources.base import Source
from acqd.sources.waveform import Waveform


class ReplaySource(Source):
    """Plays one waveform `loops` times (0: for ever). The recording's own start time wins.

    Where samples are missing in the recording, the index jumps: a gap, which takes no time to play.
    """

    live = False
    period_ns = 10_000_000  # a recording buffers: nothing is won by waking every millisecond

    def __init__(self, waveform: Waveform, loops: int = 1) -> None:
        self.form = waveform.form
        self.flags = waveform.flags | (frozenset({"simulated"}) if waveform.simulated else frozenset())
        self._waveform = waveform
        self._samples = len(waveform.codes)
        self._end = self._samples * loops if loops else None
        self._utc = 0
        self._base = 0
        self._position = 0
        self._gaps = [at for at, _ in waveform.breaks]
        edges = {at for begin, end, _ in waveform.marks for at in (begin, end)} - {0, self._samples}
        self._cuts = sorted({*self._gaps, *edges})
        self._marked = [begin for begin, _, _ in waveform.marks]
        self._lost = [0, *accumulate(lost for _, lost in waveform.breaks)]

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Begin; `utc_ns` counts only where the recording has no start time."""
        start = self._waveform.start_utc_ns
        self._utc = utc_ns if start is None else start
        self._base = index

    def read(self, limit: int) -> SampleBlock | None:
        """The next samples, None after the last loop. A block ends where samples are missing."""
        if self._end is not None and self._position >= self._end:
            return None
        count = self._until_cut(limit)
        parts, left = [], count
        loop, where = divmod(self._position, self._samples)
        while left:
            part = self._waveform.codes[where : where + left]
            parts.append(part)
            left -= len(part)
            where = 0
        codes = parts[0] if len(parts) == 1 else np.concatenate(parts) if parts else self._waveform.codes[:0]
        here = self._position % self._samples
        passed = bisect_right(self._gaps, here)
        position = self._position + loop * self._lost[-1] + self._lost[passed]
        lost = self._lost[passed] - self._lost[passed - 1] if here in self._gaps else 0
        utc = self._utc + round(position * 1e9 / self.form.rate)
        block = SampleBlock(codes, self._base + position, utc, lost, self.flags | self._flags_at(here))
        self._position += count
        return block

    def ahead(self, limit: int) -> Codes:
        """Up to the end of the recording, or to what is missing; after its last loop there is nothing."""
        where = self._position % self._samples
        if where in self._cuts:  # only `read` can jump
            return self._waveform.codes[:0]
        return self._waveform.codes[where : where + self._until_cut(limit)]

    def skip(self, count: int) -> None:
        """Nothing to do for samples that nobody wants."""
        self._position += count if self._end is None else min(count, self._end - self._position)

    def _flags_at(self, where: int) -> frozenset[str]:
        """Flags of the stretch that this sample is in."""
        place = bisect_right(self._marked, where) - 1
        if place < 0 or where >= self._waveform.marks[place][1]:
            return frozenset()
        return self._waveform.marks[place][2]

    def _until_cut(self, limit: int) -> int:
        """Samples that follow each other and have the same flags, `limit` at most."""
        count = limit if self._end is None else min(limit, self._end - self._position)
        if not self._cuts:
            return count
        where = self._position % self._samples
        place = bisect_right(self._cuts, where)
        until = self._cuts[place] if place < len(self._cuts) else self._samples
        return min(count, until - where)
