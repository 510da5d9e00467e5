"""What a look at the samples of all channels tells: extremes, steps, means, how alike the halves of a cycle are."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.block import Codes
from acqd.metering.blurred import blurred_tops
from acqd.metering.kernel.compiled import quality_library

_BITS = {np.dtype(np.int16): 16, np.dtype(np.int32): 32}
"""Types of codes that C takes."""
_FEWEST = 5  # samples, of which noise is known


class Look(NamedTuple):
    """Lists of one number per channel, in the unit of the samples."""

    least: list[float]
    most: list[float]
    step: list[float]
    """Largest difference of two neighbours."""
    at_least: list[float]
    """How many samples are the smallest one."""
    at_most: list[float]
    """How many are the largest one."""
    total: list[float]
    """Sum of the whole cycles."""
    squares: list[float]
    """Sum of their squares."""
    magnitudes: list[float]
    """Sum of their magnitudes."""
    opposite: list[float]
    """Sum of |x(t) + x(t + half a cycle)| over the first half of the first cycle; 0 without a whole cycle."""


class Looker:
    """Looks at samples of one stream. Not for two threads at once: C writes every result to the same place."""

    def __init__(self, channels: int, cycle: int) -> None:
        """`cycle` samples are a cycle."""
        self._channels, self._cycle = channels, cycle
        self._library = quality_library()
        self._out = np.empty((len(Look._fields), channels))
        self._out_at = self._out.ctypes.data
        # arrays of the last `calm`, and their addresses: to ask for one takes a microsecond
        self._kept: tuple[NDArray[Any], ...] = ()
        self._kept_at: tuple[int, ...] = ()

    def at(self, codes: Codes) -> Look:
        """At samples [samples, channels], at least one. In C where there is a compiler."""
        bits = _BITS.get(codes.dtype)
        fits = bits is not None and codes.flags.c_contiguous and codes.shape[1] == self._channels
        if self._library is None or not fits:
            return look_by_numpy(codes, self._cycle)
        self._library.acqd_look(codes.ctypes.data, bits, self._channels, len(codes), self._cycle, self._out_at)
        return Look._make(self._out.tolist())

    def blurred(self, codes: Codes, look: Look) -> bool:
        """Whether a channel of samples [samples, channels], of which `look` is one, is cut and noise hides that."""
        if len(codes) < _FEWEST:
            return False
        suspects: Iterable[int] = range(self._channels)
        bits = _BITS.get(codes.dtype)
        if self._library is not None and bits is not None and codes.flags.c_contiguous:
            ends, out = np.array((look.least, look.most)), self._out[0]
            least, most = ends.ctypes.data, ends[1].ctypes.data
            self._library.acqd_tops(codes.ctypes.data, bits, self._channels, len(codes), least, most, out.ctypes.data)
            suspects = np.flatnonzero(out).tolist()
        return any(blurred_tops(codes[:, k].astype(np.float64)) for k in suspects)

    def calm(self, codes: Codes, edges: NDArray[np.int64], due: int, usual: Floats, most: Floats) -> int:
        """How many of the blocks of `codes`, cut at `edges`, are no reason for a look; 0 without C.

        Each begins before `due` and is shorter than three cycles. `most` [channels] is the share of samples at the
        extremes of a channel that is no reason for a look, and goes on with the blocks; `usual` says how
        (signal_watch.py). Blocks shorter than a cycle are passed over.
        """
        bits = _BITS.get(codes.dtype)
        if self._library is None or bits is None or not codes.flags.c_contiguous or codes.shape[1] != self._channels:
            return 0
        if not self._kept or edges is not self._kept[0] or usual is not self._kept[1] or most is not self._kept[2]:
            self._kept = edges, usual, most
            self._kept_at = tuple(array.ctypes.data for array in self._kept)
        edges_at, usual_at, most_at = self._kept_at
        found: int = self._library.acqd_calm(
            codes.ctypes.data, bits, self._channels, len(edges) - 1, edges_at, self._cycle, due,
            usual_at, most_at, self._out_at,
        )  # fmt: skip
        return found


def look_at(codes: Codes, cycle: int) -> Look:
    """At samples [samples, channels], at least one; `cycle` samples are a cycle."""
    return Looker(codes.shape[1], cycle).at(codes)


def look_by_numpy(codes: Codes, cycle: int) -> Look:
    """The same without C: the reference."""
    x = np.ascontiguousarray(codes.T, dtype=np.float64)
    least, most = x.min(axis=1), x.max(axis=1)
    whole = x[:, : x.shape[1] // cycle * cycle]
    half = cycle // 2 if whole.shape[1] else 0
    columns = (
        least, most, np.abs(np.diff(x, axis=1)).max(axis=1, initial=0.0),
        (x == least[:, None]).sum(axis=1), (x == most[:, None]).sum(axis=1),
        whole.sum(axis=1), np.einsum("ij,ij->i", whole, whole), np.abs(whole).sum(axis=1),
        np.abs(whole[:, :half] + whole[:, half : 2 * half]).sum(axis=1),
    )  # fmt: skip
    return Look(*np.array(columns, dtype=np.float64).tolist())
