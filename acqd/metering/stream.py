"""Cutting a stream of blocks into windows: history, gaps, starts in mid-window, time.

Time is the UTC of the stream's first sample plus the sample count; a block flagged `clock_step`
sets a new anchor. The windows lie on a grid of sample numbers in which lost samples count, so a
gap never shifts what comes after it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acqd.metering.block import Codes, SampleBlock
from acqd.metering.window import WindowGrid

_Mark = tuple[int, int, frozenset[str]]  # first sample, sample after the last, flags
_ROOM = 1 << 14
"""Samples; a larger buffer is only as large as it must be."""


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


class LiveWindow(NamedTuple):
    """The usual window of a running stream: whole, and from blocks of the same flags."""

    seq: int
    utc_ns: int
    buffer: Codes
    """Contiguous; the samples of the window, its history before them, and others."""
    begin: int
    """Position of the window in the buffer."""
    end: int
    origin: int
    """Sample of the stream at position 0 of the buffer."""
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
            begin=self.origin + self.oldest,
        )


class WindowStream:
    """Collects blocks until windows are whole."""

    def __init__(self, grid: WindowGrid, history: int, batch: int) -> None:
        """Keep `history` samples before each window; hand out at most `batch` windows at once."""
        self._grid = grid
        self._history = history
        self._batch = batch
        self._buffer: Codes | None = None
        self._from = self._to = 0  # the unbroken samples in the buffer
        self._origin = 0  # index of the first of them
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
        codes, index, marks = block.codes, block.index, self._marks
        start, stop, following = self._edges
        end = index + len(codes)
        if index != self._origin + self._to - self._from or not stop <= end < following or self._orphans:
            return None
        if marks:
            if len(marks) > 1 or marks[0][2] != block.flags or not (marks[0][0] <= start and marks[0][1] == index):
                return None
            marks[0] = (marks[0][0], end, marks[0][2])
        elif block.flags:
            return None
        self._append(codes)
        assert self._buffer is not None
        seq, (origin, utc_ns), base, oldest = self._next, self._anchor, self._origin - self._from, self._from
        self._next += 1
        self._edges = stop, following, self._grid.start(seq + 3)
        self._forget(stop)
        utc_ns += round((start - origin) * 1e9 / self._grid.rate)
        return LiveWindow(seq, utc_ns, self._buffer, start - base, stop - base, base, block.flags, oldest)

    @property
    def pending(self) -> int:
        """Samples held that belong to no whole window yet."""
        if self._buffer is None:
            return 0
        orphans = sum(len(run) for run in self._orphans)
        return orphans + self._end - max(self._origin, self._grid.start(self._next))

    def feed(self, block: SampleBlock) -> Iterator[Piece]:
        """Take the next block; yield what it completes. A piece is valid until the next one."""
        if self._buffer is None:
            self._restart(block)
            self._anchor = (block.index, block.utc_ns)
            self._next = self._grid.containing(block.index)
        elif block.index != self._end:
            yield from self._break(block)
        else:
            if "clock_step" in block.flags:
                self._anchor = (block.index, block.utc_ns)
            self._append(block.codes)
        self._note_flags(block)
        yield from self._drain()
        start = self._grid.start(self._next)
        running = self._begun and self._origin <= start
        self._edges = (
            (start, self._grid.start(self._next + 1), self._grid.start(self._next + 2)) if running else (0, 0, 0)
        )

    @property
    def _end(self) -> int:
        """Index after the newest sample."""
        return self._origin + self._to - self._from

    @property
    def _run(self) -> Codes:
        """The unbroken samples from `_origin` on."""
        assert self._buffer is not None
        return self._buffer[self._from : self._to]

    def _restart(self, block: SampleBlock) -> None:
        """Unbroken samples begin with this block."""
        self._from = self._to = 0
        self._origin = block.index
        self._append(block.codes)

    def _append(self, codes: Codes) -> None:
        """Copy into the buffer, which stays where it is as long as it can."""
        buffer, to = self._buffer, self._to + len(codes)
        if buffer is None or to > len(buffer) or codes.dtype != buffer.dtype:
            buffer = self._with_room(codes)
            to = self._to + len(codes)
        buffer[self._to : to] = codes
        self._to = to

    def _with_room(self, codes: Codes) -> Codes:
        """The buffer after its unbroken samples have been moved to the front, of another one."""
        kept, old = self._to - self._from, self._buffer
        least = kept + len(codes)
        dtype = codes.dtype if old is None else np.promote_types(old.dtype, codes.dtype)
        room = old
        if old is None or room is None or least > len(room) or dtype != room.dtype:
            room = np.empty((least if least > _ROOM else 4 * least, codes.shape[1]), dtype)
        if old is not None:
            room[:kept] = old[self._from : self._to]
        self._buffer, self._from, self._to = room, 0, kept
        return room

    def _forget(self, stop: int) -> None:
        """Samples that are in no history of a window from `stop` on."""
        keep = stop - self._history - self._origin
        if keep > 0:
            self._from += keep
            self._origin += keep

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

    def _break(self, block: SampleBlock) -> Iterator[Piece]:
        """A gap before `block`: close the window that it breaks, start a new run after it."""
        if block.index < self._end:
            raise ValueError(f"block at sample {block.index} goes back before {self._end}")
        tail = self._run[max(0, self._grid.start(self._next) - self._origin) :].copy()
        if len(tail):
            self._orphans.append(tail)
        window = self._grid.containing(block.index)
        if window > self._next and self._orphans:
            yield self._broken_piece(self._orphans)
            self._orphans = []
        self._next = window
        self._restart(block)
        if "clock_step" in block.flags:
            self._anchor = (block.index, block.utc_ns)
        start = self._grid.start(window)
        if start == block.index:  # the gap ends exactly with a window: the next window carries the flag
            self._marks.append((start, start + 1, frozenset({"gap"})))

    def _drain(self) -> Iterator[Piece]:
        end = self._end
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
        self._forget(self._grid.start(self._next))

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
