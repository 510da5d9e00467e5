"""Where the samples of a recording are no measurements: flags of stretches of two cycles.

A recording is searched only where its extremes, its mean or its steps allow a fault at all: that costs a few passes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes
from acqd.metering.blurred import blurred_tops
from acqd.metering.integrity import clipped, rolled_over, saturated, shifted, uneven
from acqd.sources.recording.continuity import held

Marks = tuple[tuple[int, int, frozenset[str]], ...]
"""First sample, sample after the last, flags."""
_EQUAL = 4  # samples in a row at the extreme of a channel, from which on it may be clipped
_END = 30_000  # codes of 16 bits that roll over come near both ends
_HELD = 0.2  # of the largest peak of all phases: a channel that stands still farther from zero was held
_TOGETHER = 256  # stretches
_PASS = 1 << 16  # samples
_POINTS = 25  # of half a cycle
_LONGEST = 100_000  # samples that show the mean


def marks_of(codes: Codes, rate: float, f_nominal: float, scale: Sequence[float] = ()) -> Marks:
    """Stretches with a fault, in order; stretches with the same flags are joined.

    `scale`: V or A per code of each channel; empty: alike for one quantity.
    """
    size = max(8, round(2 * rate / f_nominal))
    flags: dict[int, set[str]] = {}
    everywhere: set[str] = set()
    units = np.abs(np.array(scale or (1.0,) * codes.shape[1]))
    peaks = np.maximum(codes.max(axis=0).astype(np.float64), -codes.min(axis=0).astype(np.float64)) * units
    for k in range(codes.shape[1]):
        x = _channel(codes, k)
        for at, fault in _faults(x, size):
            flags.setdefault(at, set()).add(fault)
        far = _HELD * float(peaks[k % 2 :: 2].max()) / float(units[k])
        least = 3 * size // 8 if k % 2 else size // 4  # half waves of a load pause for half a cycle
        for first, last in held(x, least, far, size // 2):
            for at in range(first // size, -(-last // size)):
                flags.setdefault(at, set()).add("invalid")
        if k % 2:
            for at in _saturated(x, size):
                flags.setdefault(at, set()).add("saturated")
        whole = x[: min(len(x), _LONGEST) // (size // 2) * (size // 2)].astype(np.float64)
        if k % 2 == 0 and len(whole) and shifted(whole):
            everywhere.add("offset")
        del x  # before the next channel is copied
    return _joined(flags, everywhere, size, len(codes))


def _channel(codes: Codes, k: int) -> np.ndarray:
    """Samples that lie side by side; of two channels a copy is no faster, and takes half of the memory of all."""
    return codes[:, k] if codes.shape[1] <= 2 else np.ascontiguousarray(codes[:, k])


def _faults(x: np.ndarray | Floats, size: int) -> Iterator[tuple[int, str]]:
    """Stretches in which a channel has rolled over or is clipped."""
    highest, lowest = int(x.argmax()), int(x.argmin())
    for at in _suspects(x, float(x[highest]), float(x[lowest]), size):
        part = x[at * size : (at + 1) * size + 8].astype(np.float64)
        if rolled_over(part, size // 2):
            yield at, "rollover"
        elif clipped(part, size // 2):
            yield at, "clipped"
    yield from ((at, "clipped") for at in _blurred(x, (highest, lowest), size))


def _blurred(x: np.ndarray | Floats, extremes: tuple[int, int], size: int) -> list[int]:
    """Stretches in which a channel is cut, and noise hides that: what is cut somewhere is so at its extremes."""
    count = len(x) // size
    suspects = {min(at // size, count - 1) for at in extremes} if count else set()

    def cut(at: int) -> bool:
        return blurred_tops(x[at * size : (at + 1) * size].astype(np.float64))

    return [at for at in range(count) if cut(at)] if any(map(cut, suspects)) else []


def _saturated(x: np.ndarray | Floats, size: int) -> Iterator[int]:
    """Stretches in which a current is that of a saturated transformer."""
    stretches, step = x[: len(x) // size * size].reshape(-1, size), max(1, size // 4 // _POINTS)
    half = size // 4 // step * step
    few = stretches[:, : 2 * half : step]  # enough points to see whether half waves differ
    for begin in range(0, len(few), _TOGETHER):  # as double numbers, all of them are too many
        part = few[begin : begin + _TOGETHER].astype(np.float64)
        for at in uneven(part, part.shape[1]):
            if saturated(stretches[begin + at].astype(np.float64), size // 2):
                yield begin + at


def _suspects(x: np.ndarray | Floats, most: float, least: float, size: int) -> list[int]:
    """Stretches in which a channel may be clipped or have rolled over."""
    found: set[int] = set()
    steps = x.dtype != np.int16 or (most > _END and least < -_END)
    for first in range(0, len(x), _PASS):  # double numbers and indices of all samples are too many
        part = x[first : first + _PASS + _EQUAL - 1]
        for extreme in (most, least):
            at = np.flatnonzero(part == extreme)
            begins = at[: 1 - _EQUAL][at[_EQUAL - 1 :] - at[: 1 - _EQUAL] == _EQUAL - 1]  # of runs
            found |= set(((first + begins) // size).tolist())
        if steps:
            heights = np.abs(np.diff(part.astype(np.float64)))
            found |= set(((first + np.flatnonzero(heights > 0.8 * (most - least))) // size).tolist())
    return sorted(found)


def _joined(flags: dict[int, set[str]], everywhere: set[str], size: int, samples: int) -> Marks:
    marks: list[tuple[int, int, frozenset[str]]] = []
    at = 0
    for place in sorted(flags):
        begin, end = place * size, min((place + 1) * size, samples)
        if everywhere and begin > at:
            marks.append((at, begin, frozenset(everywhere)))
        named = frozenset(flags[place] | everywhere)
        if marks and marks[-1][1:] == (begin, named):
            marks[-1] = (marks[-1][0], end, named)
        else:
            marks.append((begin, end, named))
        at = end
    if everywhere and at < samples:
        marks.append((at, samples, frozenset(everywhere)))
    return tuple(marks)
