"""Cutting a stream of blocks into windows: history, gaps, starts in mid-window, time.

Time is the UTC of the stream's first sample plus the sample count; a block flagged `clock_step`
sets a new anchor. The windows lie on a grid of sample numbers in which lost samples count, so a
gap never shifts what comes after it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acqd.metering.block import Codes, SampleBlock
from acqd.metering.window import WindowGrid

_Mark = tuple[int, int, frozenset[str]]  # first sample, sample after the last, flags


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
    begin: int = 0
    """Sample of the stream at position 0 of the only run."""
    broken: bool = False
    first: bool = False
    """This piece begins the stream."""

    @property
    def codes(self) -> Codes:
        """The only run of whole windows."""
        return self.runs[0]

    def window(self, k: int) -> Piece:
        """Window `k` alone, with its history."""
        end = self.bounds[k + 1]
        return replace(
            self,
            seq=self.seq[k : k + 1],
            utc_ns=self.utc_ns[k : k + 1],
            runs=[self.codes[:end]],
            bounds=self.bounds[k : k + 2],
            flags=self.flags[k : k + 1],
            first=self.first and k == 0,
        )

    def row_flags(self, phases: int) -> list[list[set[str]]]:
        """[phases][windows] sets to add to."""
        return [[set(flags) for flags in self.flags] for _ in range(phases)]


class WindowStream:
    """Collects blocks until windows are whole."""

    def __init__(self, grid: WindowGrid, history: int, batch: int) -> None:
        """Keep `history` samples before each window; hand out at most `batch` windows at once."""
        self._grid = grid
        self._history = history
        self._batch = batch
        self._run: Codes | None = None  # unbroken samples from index `_origin` on
        self._origin = 0
        self._next = 0  # window to hand out next
        self._orphans: list[Codes] = []  # samples of window `_next` from before a gap
        self._anchor = (0, 0)  # sample index, its UTC [ns]
        self._marks: list[_Mark] = []
        self._begun = False

    @property
    def pending(self) -> int:
        """Samples held that belong to no whole window yet."""
        if self._run is None:
            return 0
        orphans = sum(len(run) for run in self._orphans)
        return orphans + self._origin + len(self._run) - max(self._origin, self._grid.start(self._next))

    def feed(self, block: SampleBlock) -> Iterator[Piece]:
        """Take the next block; yield what it completes."""
        if self._run is None:
            self._run, self._origin = block.codes, block.index
            self._anchor = (block.index, block.utc_ns)
            self._next = self._grid.containing(block.index)
        elif block.index != self._origin + len(self._run):
            yield from self._break(block)
        else:
            if "clock_step" in block.flags:
                self._anchor = (block.index, block.utc_ns)
            self._run = np.concatenate((self._run, block.codes)) if len(self._run) else block.codes
        self._note_flags(block)
        yield from self._drain()

    def _note_flags(self, block: SampleBlock) -> None:
        last = block.index + len(block.codes)
        if block.flags:
            self._marks.append((block.index, last, block.flags - {"clock_step"}))
        if "clock_step" in block.flags:
            # The step is an event: it belongs to the first window that has the new time.
            start = self._grid.start(self._grid.containing(block.index))
            self._marks.append((start, start + 1, frozenset({"clock_step"})))

    def _break(self, block: SampleBlock) -> Iterator[Piece]:
        """A gap before `block`: close the window that it breaks, start a new run after it."""
        assert self._run is not None
        if block.index < self._origin + len(self._run):
            raise ValueError(f"block at sample {block.index} goes back before {self._origin + len(self._run)}")
        tail = self._run[max(0, self._grid.start(self._next) - self._origin) :]
        if len(tail):
            self._orphans.append(tail)
        window = self._grid.containing(block.index)
        if window > self._next and self._orphans:
            yield self._broken_piece(self._orphans)
            self._orphans = []
        self._next = window
        self._run, self._origin = block.codes, block.index
        if "clock_step" in block.flags:
            self._anchor = (block.index, block.utc_ns)
        start = self._grid.start(window)
        if start == block.index:  # the gap ends exactly with a window: the next window carries the flag
            self._marks.append((start, start + 1, frozenset({"gap"})))

    def _drain(self) -> Iterator[Piece]:
        assert self._run is not None
        end = self._origin + len(self._run)
        if self._orphans or self._origin > self._grid.start(self._next):
            stop = self._grid.start(self._next + 1)
            if end < stop:
                return
            yield self._broken_piece([*self._orphans, self._run[: stop - self._origin]])
            self._orphans = []
            self._next += 1
        while self._grid.start(self._next + 1) <= end:
            count = min(self._batch, self._grid.containing(end) - self._next)
            starts = self._grid.starts(self._next, count)
            begin = max(self._origin, int(starts[0]) - self._history)
            yield Piece(
                seq=np.arange(self._next, self._next + count),
                utc_ns=self._utc(starts[:-1]),
                runs=[self._run[begin - self._origin : int(starts[-1]) - self._origin]],
                bounds=starts - begin,
                flags=self._flags(starts),
                begin=begin,
                first=self._begin(),
            )
            self._next += count
        keep = max(0, self._grid.start(self._next) - self._history - self._origin)
        if keep:
            self._run, self._origin = self._run[keep:], self._origin + keep

    def _broken_piece(self, runs: list[Codes]) -> Piece:
        starts = self._grid.starts(self._next, 1)
        return Piece(
            seq=np.array([self._next]),
            utc_ns=self._utc(starts[:-1]),
            runs=runs,
            bounds=np.empty(0, dtype=np.int64),
            flags=self._flags(starts),
            broken=True,
            first=self._begin(),
        )

    def _begin(self) -> bool:
        first, self._begun = not self._begun, True
        return first

    def _utc(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        origin, utc = self._anchor
        if len(index) == 1:
            return np.array([utc + round((int(index[0]) - origin) * 1e9 / self._grid.rate)])
        offset = (index - origin) * 1e9 / self._grid.rate
        return np.asarray(utc + np.rint(offset).astype(np.int64))

    def _flags(self, starts: NDArray[np.int64]) -> list[frozenset[str]]:
        """Flags of each window, and forget the marks that lie behind them all."""
        if not self._marks:
            return [frozenset()] * (len(starts) - 1)
        stop = int(starts[-1])
        marks = [mark for mark in self._marks if mark[0] < stop]
        flags = [
            frozenset().union(*(named for first, after, named in marks if first < end and after > start))
            for start, end in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)
        ]
        self._marks = [mark for mark in self._marks if mark[1] > stop]
        return flags
