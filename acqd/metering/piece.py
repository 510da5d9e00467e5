"""Windows that are ready to be metered, with their history."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acqd.metering.block import Codes


@dataclass(frozen=True, slots=True)
class Piece:
    """Consecutive whole windows, or one broken window, with what metering them needs."""

    seq: NDArray[np.int64]
    utc_ns: NDArray[np.int64]
    runs: list[Codes]
    """Unbroken runs of samples: one for whole windows (history first), any number for a broken one."""
    bounds: NDArray[np.int64]
    """Window bounds as positions in the only run; empty for a broken window."""
    flags: list[frozenset[str]]
    """[windows] flags of the blocks each window touches."""
    broken: bool = False
    first: bool = False
    """This piece begins the stream."""
    history: int = 0
    """Samples before a window that metering it needs."""

    @property
    def codes(self) -> Codes:
        """The only run of whole windows."""
        return self.runs[0]

    def window(self, k: int) -> Piece:
        """Window `k` alone, with its history: the same numbers as if no other window had been ready with it."""
        start, end = self.bounds[k], self.bounds[k + 1]
        begin = max(0, start - self.history)
        return replace(
            self,
            seq=self.seq[k : k + 1],
            utc_ns=self.utc_ns[k : k + 1],
            runs=[self.codes[begin:end]],
            bounds=self.bounds[k : k + 2] - begin,
            flags=self.flags[k : k + 1],
            first=self.first and k == 0,
        )

    def row_flags(self, phases: int) -> list[list[set[str]]]:
        """[phases][windows] sets to add to."""
        return [[set(flags) for flags in self.flags] for _ in range(phases)]


@dataclass(slots=True)
class LiveWindow:
    """The usual window of a running stream: whole, and from blocks of the same flags."""

    seq: int
    utc_ns: int
    buffer: Codes
    """Contiguous; the samples of the window, its history before them, and others."""
    begin: int
    """Position of the window in the buffer."""
    end: int
    flags: frozenset[str]
    oldest: int
    """Position of the oldest sample of the history."""

    def piece(self) -> Piece:
        """The same as a piece of one window."""
        bounds = np.array((self.begin, self.end)) - self.oldest
        return Piece(
            seq=np.array([self.seq]),
            utc_ns=np.array([self.utc_ns]),
            runs=[self.buffer[self.oldest : self.end]],
            bounds=bounds,
            flags=[self.flags],
        )
