"""The energy register: W without rounding, import and export kept separately.

A window's energy is the sum of u_code * i_code over its samples: an integer below 2^41, exact in
a double. The registers add those integers as Python integers, so a year at 20 kHz (6.3e11
samples) loses nothing; the only rounding is the one conversion to kWh when a row is written.
Sums of physical values (codes of 64 bits) become integers of a fine step first.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from acqd.arrays import Floats

_WS_PER_KWH = 3_600_000
_STEPS = 2**64  # of a product of physical values


@dataclass(frozen=True, slots=True)
class EnergyColumns:
    """Register readings at the end of each window, [phases, windows], kWh."""

    imported: Floats
    exported: Floats


class EnergyRegister:
    """Import and export registers of all phases of one stream."""

    def __init__(
        self,
        kwh_per_count: list[float],
        start: list[tuple[float, float]] | None = None,
        *,
        integers: bool = True,
        creep_kWh: float = 0.0,
    ) -> None:
        """`kwh_per_count[p]` is the energy of one u_code * i_code of phase p over one sample.

        `start` is each phase's (imported, exported) [kWh] to continue from after a restart. `integers`: codes are.
        A window with less than `creep_kWh`, in either direction, does not count (no-load condition of IEC 62053-21).
        """
        self._integers = integers
        self._steps = 1 if integers else _STEPS
        self._unit = [Fraction(unit) / self._steps for unit in kwh_per_count]
        self._float_unit = np.array(kwh_per_count)
        self._least = creep_kWh / self._float_unit
        begin = start or [(0.0, 0.0)] * len(kwh_per_count)
        # Starting readings become counts too (1e-9 of a count is far below the meter's resolution).
        self._counts = [
            [round(Fraction(reading) / unit) for reading in pair] for pair, unit in zip(begin, self._unit, strict=True)
        ]

    @staticmethod
    def kwh_per_count(volts_per_digit: float, amperes_per_digit: float, rate: float) -> float:
        """Energy [kWh] of one product of codes at `rate` samples/s."""
        return volts_per_digit * amperes_per_digit / rate / _WS_PER_KWH

    def add(self, counts: Floats) -> EnergyColumns:
        """Add the windows' code-product sums, [phases, windows], and read the registers.

        A window imports or exports as a whole: within a mains cycle reactive power swings both ways.
        """
        if self._least.any():
            counts = np.where(np.abs(counts) < self._least[:, None], 0.0, counts)
        if self._integers and counts.shape[1] == 1:
            return self._add_one(counts[:, 0].tolist())
        sums = counts.astype(np.int64) if self._integers else counts
        running = np.cumsum(np.stack((np.maximum(sums, 0), np.maximum(-sums, 0))), axis=2)
        before = np.array(self._counts, dtype=np.float64).T[:, :, None] / self._steps
        imported, exported = (before + running) * self._float_unit[:, None]
        for direction, totals in enumerate(running[:, :, -1].tolist()):
            for phase, added in enumerate(totals):
                self._counts[phase][direction] += added if self._integers else round(Fraction(added) * self._steps)
        return EnergyColumns(imported, exported)

    def _add_one(self, sums: list[float]) -> EnergyColumns:
        """One window: without the price of arrays."""
        for counts, sum_ in zip(self._counts, sums, strict=True):
            counts[sum_ < 0] += abs(int(sum_))
        now = np.array(self._counts, dtype=np.float64) * self._float_unit[:, None]
        return EnergyColumns(now[:, :1], now[:, 1:])

    def reading(self) -> list[tuple[float, float]]:
        """Each phase's (imported, exported) [kWh] now."""
        now = np.array(self._counts, dtype=np.float64) / self._steps * self._float_unit[:, None]
        return [(imported, exported) for imported, exported in now.tolist()]
