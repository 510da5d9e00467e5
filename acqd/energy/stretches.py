"""The energy register cut into stretches between readings, each counted in whole nWh, so that sums are exact.

A row belongs to the period in which its window begins. What the register counted where rows lack is known of a
period only if the gap lies within it; otherwise it stays a stretch of its own, and so does a jump of the register that
no power explains. Periods, gaps and jumps together are the last reading minus the first, to the last digit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

import numpy as np

from acqd.arrays import Floats
from acqd.storage.buckets import Buckets

NWH_PER_KWH = 10**12
_SAMPLED_S = 0.06
"""Rows of samples are 40 or 50 ms apart; those of RMS meters 0.1 s or more."""
_CLEARLY = 1.5
"""A reading may exceed what the extreme powers give by this factor: rows that are missing may have been higher."""
_COARSEST_REGISTER_KWH = 1.0
"""Resolution of the registers of large meters."""
_UNCONFIRMED_S = 1.5
"""W may be up to a second back after a power cut (flag W_unconfirmed)."""
_SAME = 0.02
"""P of the rows and the register agree to 1e-4 in rows of samples; instantaneous values of meters to some percent."""


class Kind(IntEnum):
    """What a stretch is."""

    KNOWN = 0
    """Belongs to the bucket in which it ends, or to a gap within one period."""
    GAP = 1
    """Energy over a boundary of periods where rows lack: it belongs to no single period."""
    JUMP = 2
    """The register was exchanged or set, or two daemons counted under one name: no energy."""


@dataclass(frozen=True, slots=True)
class Stretches:
    """One per bucket with a reading, but for the first without a reading before."""

    begin: np.ndarray
    """[n] int64 Unix s: where the bucket before ended."""
    start: np.ndarray
    """[n] int64 Unix s of the bucket."""
    end: np.ndarray
    nWh: np.ndarray
    """[n] int64; of Python's integers where a step of the register is larger than that."""
    kind: np.ndarray
    """[n] of Kind."""

    @property
    def register_nWh(self) -> int:  # noqa: N802
        """Last reading minus the first."""
        return int(self.nWh.sum())


FirstReading = Callable[[int, int], float | None]
"""The first reading [kWh] of the rows between two Unix times [s]."""


def nwh(kwh: float) -> int:
    """A reading in nWh (1e-12 kWh), below the resolution of any register."""
    numerator, denominator = kwh.as_integer_ratio()
    return (numerator * NWH_PER_KWH + denominator // 2) // denominator


def stretches_of(
    buckets: Buckets, interval_s: float, boundaries: Sequence[int], first_reading: FirstReading = lambda *_: None
) -> Stretches:
    """Stretches of all buckets; `interval_s`: time between rows [s]; `boundaries`: Unix times [s], rising.

    `first_reading` is asked where a bucket follows a gap over a boundary: it tells the gap's energy from the bucket's.
    """
    known = np.array([k for k, W in enumerate(buckets.W) if W is not None], dtype=np.int64)
    readings = [nwh(W) for W in buckets.W if W is not None]
    if not len(known):
        return Stretches(*(np.zeros(0, dtype=np.int64) for _ in range(5)))
    start, end = buckets.start[known], buckets.start[known] + buckets.seconds[known]
    energy = _integers([later - earlier for earlier, later in pairwise(readings)])
    rules = _Rules(buckets, interval_s, np.asarray(boundaries))
    adjacent = end[:-1] == start[1:]
    columns = end[:-1], start[1:], end[1:], energy, rules.kinds(known[1:], start[1:], end[1:], energy)
    cut = [tuple(row) for row in np.array([column[adjacent] for column in columns]).T.tolist()]
    if (first := _first(first_reading, int(start[0]), int(end[0]))) is not None:
        cut.append((int(start[0]), int(start[0]), int(end[0]), readings[0] - first, int(Kind.KNOWN)))
    for k in (np.flatnonzero(~adjacent) + 1).tolist():
        begin, at, until = int(end[k - 1]), int(start[k]), int(end[k])
        if rules.of_rows(int(known[k]), int(energy[k - 1])):
            begin = at  # the gap holds no energy
        kind = rules.kind_after_gap(begin, at, until, int(energy[k - 1]))
        first = None if kind == Kind.KNOWN else _first(first_reading, at, until)
        if first is None:
            cut.append((begin, at, until, int(energy[k - 1]), kind))
            continue
        over, rest = first - readings[k - 1], readings[k] - first
        cut.append((begin, at, at, over, rules.kind_of_gap(begin, at, over)))
        own = rules.kinds(known[k : k + 1], start[k : k + 1], end[k : k + 1], _integers([rest]))
        cut.append((at, at, until, rest, int(own[0])))
    begins, starts, ends, energies, kinds = zip(*sorted(cut), strict=True) if cut else ((),) * 5
    begin_s, start_s, end_s, kind_of = (np.array(each, dtype=np.int64) for each in (begins, starts, ends, kinds))
    return Stretches(begin_s, start_s, end_s, _integers(energies), kind_of)


def _integers(values: Sequence[int]) -> np.ndarray:
    """As int64 where all of them together fit; exact anyway."""
    return np.array(values, dtype=np.int64 if sum(map(abs, values)) < 2**63 else object)


def _first(first_reading: FirstReading, begin: int, end: int) -> int | None:
    found = first_reading(begin, end)
    return None if found is None else nwh(found)


class _Rules:
    """What a difference of two readings can be."""

    def __init__(self, buckets: Buckets, interval_s: float, boundaries: np.ndarray) -> None:
        self._buckets, self._interval, self._boundaries = buckets, interval_s, boundaries
        finite = np.isfinite(buckets.P_max) & np.isfinite(buckets.P_min)
        self._most = float(buckets.P_max[finite].max(initial=0.0))
        self._least = float(buckets.P_min[finite].min(initial=0.0))
        self._low = np.where(finite, buckets.P_min, self._least)
        self._high = np.where(finite, buckets.P_max, self._most)
        self._sampled = interval_s < _SAMPLED_S
        self._one_row = self._most * interval_s / 3.6e6 * NWH_PER_KWH

    def kinds(self, bucket: np.ndarray, start: np.ndarray, end: np.ndarray, energy: np.ndarray) -> np.ndarray:
        """Of the energies [nWh] of buckets that follow another one without a gap."""
        plausible = self._plausible(energy, self._low[bucket], self._high[bucket], end - start)
        crossed = self._crossed(start, end - 1)
        return np.where(plausible, np.where(crossed, Kind.GAP, Kind.KNOWN), Kind.JUMP)

    def kind_after_gap(self, begin: int, start: int, end: int, energy: int) -> Kind:
        """Of the energy [nWh] between the end of a bucket and the end of a later one."""
        crossed = bool(self._crossed(begin, start))
        inside = bool(self._crossed(start, end - 1))
        if not self._plausible(energy, self._least, self._most, end - begin):
            return Kind.JUMP
        return Kind.GAP if crossed or inside else Kind.KNOWN

    def kind_of_gap(self, begin: int, start: int, energy: int) -> Kind:
        """Of the energy [nWh] from the end of a bucket to the first row of a later one."""
        if not self._plausible(energy, self._least, self._most, start - begin + self._interval):
            return Kind.JUMP
        within = not self._crossed(begin, start) or abs(energy) <= _CLEARLY * self._one_row
        return Kind.KNOWN if within else Kind.GAP

    def _crossed(self, begin: int | np.ndarray, end: int | np.ndarray) -> np.ndarray:
        """Whether a boundary lies after `begin` and not after `end`."""
        first, last = (np.searchsorted(self._boundaries, at, side="right") for at in (begin, end))
        return np.asarray(last > first)

    def of_rows(self, bucket: int, energy: int) -> bool:
        """Whether P of the rows explains the energy: then the gap before them holds none."""
        P, rows = float(self._buckets.P[bucket]), int(self._buckets.rows[bucket])
        expected = P * rows * self._interval / 3.6e6 * NWH_PER_KWH
        return self._sampled and abs(energy - expected) <= _SAME * abs(expected) + 2 * self._one_row

    def _plausible(
        self, energy: int | np.ndarray, low_W: float | Floats, high_W: float | Floats, seconds: float | np.ndarray
    ) -> np.ndarray:
        back = max(abs(self._most), abs(self._least)) * _UNCONFIRMED_S / 3.6e6
        coarse = 0.0 if self._sampled else 1.5 * _COARSEST_REGISTER_KWH
        low = np.minimum(low_W, 0.0) * _CLEARLY * seconds / 3.6e6 - back - np.where(np.less(low_W, 0), coarse, 0.0)
        high = np.maximum(high_W, 0.0) * _CLEARLY * seconds / 3.6e6 + back + coarse
        return np.asarray((low * NWH_PER_KWH <= energy) & (energy <= high * NWH_PER_KWH))


def known_seconds(buckets: Buckets, interval_s: float) -> Floats:
    """[n] s of each bucket that its rows cover."""
    return np.asarray(np.minimum(buckets.rows * interval_s, buckets.seconds), dtype=np.float64)
