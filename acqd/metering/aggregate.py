"""The 10/12-cycle value of IEC 61000-4-30 (about 200 ms): gapless, over exact cycles.

10 cycles at 50 Hz, 12 at 60 Hz. A 40 ms window is not a value of IEC 61000-4-30. This one is, as far
as the method goes; the instrument's uncertainty depends on its hardware.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes, SampleBlock, StreamFormat
from acqd.metering.interval import interval_sums
from acqd.metering.window import WindowBatch


@dataclass(frozen=True, slots=True)
class TenTwelveCycleValue:
    """One aggregation interval."""

    utc_ns: int
    duration: float
    """s."""
    cycles: int
    Vrms: Floats
    """[phases] V."""
    Irms: Floats
    """[phases] A."""
    P: Floats
    """[phases] W."""
    f: float
    """Hz."""
    flags: frozenset[str] = field(default_factory=frozenset)


class TenTwelveCycle:
    """Each interval begins where the last one ended; a gap or dead mains begins a new chain."""

    def __init__(self, form: StreamFormat) -> None:
        self._form = form
        self._cycles = 12 if form.f_nominal > 55 else 10
        scale = np.asarray(form.scale)
        self._u, self._i = scale[0::2], scale[1::2]
        self._codes: Codes = np.empty((0, len(form.scale)), dtype=np.int16)
        self._origin = 0
        self._utc = (0, 0)
        self._begin: float | None = None  # stream position where the next interval starts
        self._f: list[tuple[int, float, frozenset[str]]] = []  # window start, Hz, flags

    def feed(self, block: SampleBlock, batch: WindowBatch | None) -> Iterator[TenTwelveCycleValue]:
        """Values completed by `block`, whose windows are `batch` (as the meter gave it)."""
        if self._begin is None or block.index != self._origin + len(self._codes):
            self._codes, self._origin = block.codes, block.index
            self._utc = (block.index, block.utc_ns)
            self._begin = float(block.index)
            self._f.clear()
        else:
            self._codes = np.concatenate((self._codes, block.codes))
        if batch is not None:
            offsets = np.rint((batch.utc_ns - self._utc[1]) * 1e-9 * self._form.rate).astype(int) + self._utc[0]
            flags = [frozenset().union(*(phase[k] for phase in batch.flags)) for k in range(len(batch))]
            self._f += list(zip(offsets.tolist(), batch.f.tolist(), flags, strict=True))
        yield from self._intervals()
        keep = int(self._begin) - self._origin
        self._codes, self._origin = self._codes[keep:], self._origin + keep

    def _intervals(self) -> Iterator[TenTwelveCycleValue]:
        assert self._begin is not None
        nominal = self._cycles * self._form.rate / self._form.f_nominal
        while True:
            inside = [entry for entry in self._f if self._begin <= entry[0] + 1 and entry[0] < self._begin + nominal]
            known_until = self._f[-1][0] if self._f else -1
            if known_until < self._begin + 1.2 * nominal:
                return
            values = [f for _, f, _ in inside if not np.isnan(f)]
            if len(values) < len(inside) or not values:
                self._begin += nominal  # no cycles to count here
            else:
                f = float(np.mean(values))
                length = self._cycles * self._form.rate / f
                yield self._value(self._begin, length, f, frozenset().union(*(named for _, _, named in inside)))
                self._begin += length
            self._f = [entry for entry in self._f if entry[0] + 1 >= self._begin]

    def _value(self, begin: float, length: float, f: float, flags: frozenset[str]) -> TenTwelveCycleValue:
        start = begin - self._origin
        first, last = int(start), int(start + length) + 2
        codes = self._codes[max(first - 1, 0) : last].astype(np.float64)
        start -= max(first - 1, 0)
        u, i = codes[:, 0::2].T, codes[:, 1::2].T
        bounds = np.array([start]), np.array([start + length])
        means = interval_sums(np.stack((u * u, i * i, u * i)), *bounds)[..., 0] / length
        index, utc = self._utc
        return TenTwelveCycleValue(
            utc_ns=utc + round((begin - index) * 1e9 / self._form.rate),
            duration=length / self._form.rate,
            cycles=self._cycles,
            Vrms=np.sqrt(means[0]) * self._u,
            Irms=np.sqrt(means[1]) * self._i,
            P=means[2] * self._u * self._i,
            f=f,
            flags=flags,
        )
