"""Cutting a stream of blocks into windows: history, gaps, starts in mid-window, time.

Time is the UTC of the stream's first sample plus the sample count; a block flagged `clock_step`
sets a new anchor. The windows lie on a grid of sample numbers in which lost samples count, so a
gap never shifts what comes after it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from acqd.metering.block import Codes, SampleBlock
from acqd.metering.packed import State, packed, unpacked
from acqd.metering.piece import LiveWindow, Piece
from acqd.metering.sample_buffer import SampleBuffer
from acqd.metering.window import WindowGrid

_Mark = tuple[int, int, frozenset[str]]  # first sample, sample after the last, flags


class WindowStream:
    """Collects blocks until windows are whole."""

    def __init__(self, grid: WindowGrid, history: int, batch: int) -> None:
        """Keep `history` samples before each window; hand out at most `batch` windows at once."""
        self._grid = grid
        self._history = history
        self._batch = batch
        self._samples: SampleBuffer | None = None
        self._next = 0  # window to hand out next
        self._orphans: list[Codes] = []  # samples of window `_next` from before a gap
        self._anchor = (0, 0)  # sample index, its UTC [ns]
        self._marks: list[_Mark] = []
        self._begun = False
        self._edges = (0, 0, 0)  # start of window `_next` and of the two after it, while the stream runs

    def live(self, block: SampleBlock) -> LiveWindow | None:
        """Take a block that completes just one window, as every block does while a stream runs.

        None: the block is another one, for `feed`, and was not taken.
        """
        samples, flags = self._samples, block.flags
        start, stop, following = self._edges
        end = block.index + len(block.codes)
        if samples is None or block.index != samples.end or not stop <= end < following or self._orphans:
            return None
        if self._marks or flags:
            if not self._goes_on(block, start):
                return None
            self._marks[0] = (self._marks[0][0], end, flags)
        samples.append(block.codes)
        seq, oldest, (anchor, utc_ns) = self._next, samples.begin, self._anchor
        shift = oldest - samples.origin
        self._next = seq + 1
        self._edges = stop, following, self._grid.start(seq + 3)
        samples.forget(stop - self._history)
        utc_ns += round((start - anchor) * 1e9 / self._grid.rate)
        return LiveWindow(seq, utc_ns, samples.codes, start + shift, stop + shift, flags, oldest)

    def _goes_on(self, block: SampleBlock, start: int) -> bool:
        """Whether the flags of `block` are just those of all samples since `start`."""
        if len(self._marks) != 1:
            return False
        first, after, named = self._marks[0]
        return named == block.flags and first <= start and after == block.index

    def state(self) -> State:
        """Samples that belong to no whole window yet, with the history before them, and the clock."""
        return {
            "samples": None if self._samples is None else self._samples.state(),
            "next": self._next,
            "orphans": [packed(run) for run in self._orphans],
            "anchor": list(self._anchor),
            "marks": [[first, after, sorted(named)] for first, after, named in self._marks],
            "begun": self._begun,
            "edges": list(self._edges),
        }

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._samples = None if state["samples"] is None else SampleBuffer.of(state["samples"])
        self._next, self._begun = state["next"], state["begun"]
        self._orphans = [unpacked(run) for run in state["orphans"]]
        self._marks = [(first, after, frozenset(named)) for first, after, named in state["marks"]]
        self._anchor, self._edges = tuple(state["anchor"]), tuple(state["edges"])

    @property
    def pending(self) -> int:
        """Samples held that belong to no whole window yet."""
        if self._samples is None:
            return 0
        orphans = sum(len(run) for run in self._orphans)
        return orphans + self._samples.end - max(self._samples.origin, self._grid.start(self._next))

    def feed(self, block: SampleBlock) -> Iterator[Piece]:
        """Take the next block; yield what it completes. A piece is valid until the next one."""
        samples = self._samples
        if samples is None:
            samples = self._samples = SampleBuffer(block.codes, block.index)
            self._anchor = (block.index, block.utc_ns)
            self._next = self._grid.containing(block.index)
        elif block.index != samples.end:
            yield from self._break(block, samples)
        else:
            if "clock_step" in block.flags:
                self._anchor = (block.index, block.utc_ns)
            samples.append(block.codes)
        self._note_flags(block)
        yield from self._drain(samples)
        start, stop, following = (self._grid.start(self._next + k) for k in range(3))
        running = self._begun and samples.origin <= start
        self._edges = (start, stop, following) if running else (0, 0, 0)

    def _note_flags(self, block: SampleBlock) -> None:
        last = block.index + len(block.codes)
        if block.flags:
            named = block.flags - {"clock_step"}
            if self._marks and self._marks[-1][1:] == (block.index, named):
                self._marks[-1] = (self._marks[-1][0], last, named)
            else:
                self._marks.append((block.index, last, named))
        if "clock_step" in block.flags:
            # The step is an event: it belongs to the first window that has the new time.
            start = self._grid.start(self._grid.containing(block.index))
            self._marks.append((start, start + 1, frozenset({"clock_step"})))

    def _break(self, block: SampleBlock, samples: SampleBuffer) -> Iterator[Piece]:
        """A gap before `block`: close the window that it breaks, start a new run after it."""
        if block.index < samples.end:
            raise ValueError(f"block at sample {block.index} goes back before {samples.end}")
        tail = samples.run[max(0, self._grid.start(self._next) - samples.origin) :].copy()
        if len(tail):
            self._orphans.append(tail)
        window = self._grid.containing(block.index)
        if window > self._next and self._orphans:
            yield self._broken_piece(self._orphans)
            self._orphans = []
        self._next = window
        samples.restart(block.codes, block.index)
        if "clock_step" in block.flags:
            self._anchor = (block.index, block.utc_ns)
        start = self._grid.start(window)
        if start == block.index:  # the gap ends exactly with a window: the next window carries the flag
            self._marks.append((start, start + 1, frozenset({"gap"})))

    def _drain(self, samples: SampleBuffer) -> Iterator[Piece]:
        end, origin = samples.end, samples.origin
        if self._orphans or origin > self._grid.start(self._next):
            stop = self._grid.start(self._next + 1)
            if end < stop:
                return
            yield self._broken_piece([*self._orphans, samples.run[: stop - origin]])
            self._orphans = []
            self._next += 1
        while self._grid.start(self._next + 1) <= end:
            count = min(self._batch, self._grid.containing(end) - self._next)
            starts = self._grid.starts(self._next, count)
            begin = max(origin, int(starts[0]) - self._history)
            yield Piece(
                seq=np.arange(self._next, self._next + count),
                utc_ns=self._utc(starts[:-1]),
                runs=[samples.run[begin - origin : int(starts[-1]) - origin]],
                bounds=starts - begin,
                flags=self._flags(starts),
                first=self._begin(),
                history=self._history,
            )
            self._next += count
        samples.forget(self._grid.start(self._next) - self._history)

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
        self._marks = [mark for mark in self._marks if mark[1] >= stop]  # the next block may go on with the last one
        return flags
