"""The energy register: W without rounding, import and export kept separately.

A window's energy is the sum of u_code * i_code over its samples: an integer below 2^41, exact in
a double. The registers add those integers as Python integers, so a year at 20 kHz (6.3e11
samples) loses nothing; the only rounding is the one conversion to kWh when a row is written.
Sums of physical values (codes of 64 bits) become integers of a fine step first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import mul

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import CODE_MAX, StreamFormat
from acqd.metering.packed import State

_WS_PER_KWH = 3_600_000
_STEPS = 2**64  # of a product of physical values
_MOST = 2.0**62  # counts that are added as integers of 64 bits


@dataclass(frozen=True, slots=True)
class EnergyColumns:
    """Register readings at the end of each window, [phases, windows], kWh."""

    imported: Floats
    exported: Floats


NO_LOAD = 1e-4
"""Share of nominal voltage times full-scale current that no load is: a tenth of the starting current of class 0.5 S
(0.1 % of the rated one, IEC 62053-22, table 4), and hundreds of times what noise of a 16-bit converter counts."""


def no_load_W(form: StreamFormat, nominal_voltage: float) -> float:  # noqa: N802 - the unit
    """Power of a phase [W] below which a window is without load, by the stream's smallest range of current.

    0 where codes have no end stop of a converter, and the range of the current is not known.
    """
    if form.bits != 16:
        return 0.0
    full_scale = min(form.scale[1::2]) * CODE_MAX / math.sqrt(2)
    return NO_LOAD * nominal_voltage * full_scale


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
        self._per_step = [unit / self._steps for unit in kwh_per_count]
        self._creeps, self._least = creep_kWh > 0, [creep_kWh / unit for unit in kwh_per_count]
        begin = start or [(0.0, 0.0)] * len(kwh_per_count)
        # Starting readings become counts too (1e-9 of a count is far below the meter's resolution).
        self._imported, self._exported = (
            [round(Fraction(pair[k]) / unit) for pair, unit in zip(begin, self._unit, strict=True)] for k in (0, 1)
        )
        self._readings = self._read()  # kept: a window changes a reading or two
        self._direction = [0.0] * len(begin)  # of each phase in the last whole window, by its sign
        self._deferred: list[int] = []  # counts of parts of windows against that direction; empty: none

    @staticmethod
    def kwh_per_count(volts_per_digit: float, amperes_per_digit: float, rate: float) -> float:
        """Energy [kWh] of one product of codes at `rate` samples/s."""
        return volts_per_digit * amperes_per_digit / rate / _WS_PER_KWH

    def add(self, counts: Floats) -> EnergyColumns:
        """Add the windows' code-product sums, [phases, windows], and read the registers.

        A window imports or exports as a whole: within a mains cycle reactive power swings both ways.
        """
        # The readings must not depend on how many windows come together: each is that of the whole count.
        if self._integers and not self._deferred and 1 < counts.shape[1] < _MOST / np.abs(counts).max(initial=1.0):
            return self._add_integers(counts)
        return _columns([self.add_window(window) for window in counts.T.tolist()])

    def add_part(self, counts: list[float], power: list[float]) -> EnergyColumns:
        """Add what is left of a window with samples missing, [phases], and read the registers.

        `power` is the mean over whole cycles, in any unit; NaN without any, or where it is not known: then the
        direction is that of the whole window before. A part of a cycle may have energy against the direction, for
        reactive power swings: that is added with the next window. Otherwise each gap could export what nobody has
        exported, and W of an importing phase would fall.
        """
        sums, self._deferred = self._with_deferred(self._under_load(counts)), []
        for phase, (sum_, watts) in enumerate(zip(sums, power, strict=True)):
            toward = self._direction[phase] if math.isnan(watts) else watts
            if sum_ < 0 < toward or toward < 0 < sum_ or not toward:
                self._deferred = self._deferred or [0] * len(sums)
                self._deferred[phase], sums[phase] = self._steps_of(sum_), 0
        return _columns([self._turn(sums)])

    def _add_integers(self, counts: Floats) -> EnergyColumns:
        """Windows whose sums fit into 64 bits together, as `add_window` adds them one after the other."""
        if self._creeps:
            counts = np.where(np.abs(counts) < np.array(self._least)[:, None], 0.0, counts)
        self._direction = counts[:, -1].tolist()
        sums = counts.astype(np.int64)
        readings = []
        for registers, added in ((self._imported, np.maximum(sums, 0)), (self._exported, np.maximum(-sums, 0))):
            running = np.cumsum(added, axis=1).tolist()
            begins = list(registers)
            readings.append([
                [(begin + more) * step for more in own]
                for begin, own, step in zip(begins, running, self._per_step, strict=True)
            ])  # fmt: skip
            registers[:] = [begin + own[-1] for begin, own in zip(begins, running, strict=True)]
        self._readings = self._read()
        imported, exported = np.array(readings)
        return EnergyColumns(imported, exported)

    def add_window(self, counts: list[float]) -> list[float]:
        """Add one window, [phases]; imported readings of all phases, then the exported ones [kWh]."""
        if self._creeps:
            counts = self._under_load(counts)
        self._direction = counts
        if self._deferred:
            both, self._deferred = self._with_deferred(counts), []
            return self._turn(both)
        return self._turn(counts)

    def _under_load(self, counts: list[float]) -> list[float]:
        """Zero for the phases without load."""
        return [0.0 if abs(sum_) < least else sum_ for sum_, least in zip(counts, self._least, strict=True)]

    def _with_deferred(self, counts: Sequence[float]) -> list[float | Fraction]:
        """What a window is worth with what an earlier part of one has left to it: exactly."""
        deferred = self._deferred or [0] * len(counts)
        return [Fraction(sum_) + Fraction(steps, self._steps) for sum_, steps in zip(counts, deferred, strict=True)]

    def _turn(self, counts: Sequence[float | Fraction]) -> list[float]:
        """Add to the registers; their readings as in `add_window`."""
        imported, exported, per_step, readings = self._imported, self._exported, self._per_step, self._readings
        integers, phases = self._integers, len(per_step)
        for phase, sum_ in enumerate(counts):
            added = int(sum_) if integers else self._steps_of(sum_)
            if added > 0:
                total = imported[phase] = imported[phase] + added
                readings[phase] = total * per_step[phase]
            elif added:
                total = exported[phase] = exported[phase] - added
                readings[phases + phase] = total * per_step[phase]
        return readings.copy()

    def _steps_of(self, sum_: float | Fraction) -> int:
        return round(Fraction(sum_) * self._steps)

    def state(self) -> State:
        """The registers in counts, and what decides about the next part of a window."""
        return {
            "imported": list(self._imported), "exported": list(self._exported),
            "direction": list(self._direction), "deferred": list(self._deferred),
        }  # fmt: skip

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._imported, self._exported = list(state["imported"]), list(state["exported"])
        self._readings = self._read()
        self._direction = list(state.get("direction") or [0.0] * len(self._imported))  # files of earlier versions
        self._deferred = list(state.get("deferred", []))

    def reading(self) -> list[tuple[float, float]]:
        """Each phase's (imported, exported) [kWh] now."""
        phases = len(self._per_step)
        return list(zip(self._readings[:phases], self._readings[phases:], strict=True))

    def _read(self) -> list[float]:
        """Imported readings of all phases, then the exported ones [kWh]."""
        return [*map(mul, self._imported, self._per_step), *map(mul, self._exported, self._per_step)]


def _columns(windows: list[list[float]]) -> EnergyColumns:
    """Readings of windows one after the other as columns."""
    imported, exported = np.array(windows).T.reshape(2, -1, len(windows))
    return EnergyColumns(imported, exported)
