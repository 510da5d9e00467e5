"""Which columns of a text export tell the time, and what they say."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.recording.channel import Recording
from acqd.sources.recording.clock import Clock, of_times, unix_s
from acqd.sources.recording.siblings import skew
from acqd.sources.recording.units import CLOCK_NAMES, TIME_NAMES, UnknownUnitError, unit_of
from acqd.sources.text import clock
from acqd.sources.text.layout import key_of
from acqd.sources.text.rows import Rows
from acqd.sources.text.table import is_number
from acqd.sources.waveform import ChannelMap

SAME_RATE = 5e-3  # how far the rate above a table may be from that of its times: increments are printed with 3 digits
_EVEN = 0.01
"""Of a step: how far the steps of a column without a name may be from each other to be those of times."""
_TIME_STEPS_S = (1e-8, 5e-3)
_INDEX = ("sequence", "index", "sample", "samples", "no", "nr", "n", "point", "points", "number", "xindex")
_TIMES = (*(key_of(name) for name in TIME_NAMES), "xvalue", "timesec", "timeaxis", "abstime", "reltime", "domain")


class Times:
    """The times of one table."""

    def __init__(self, rows: Rows) -> None:
        self.rows, self.table = rows, rows.table

    def columns(self) -> tuple[list[int], float]:
        """Columns that tell the time, and seconds per unit: one of numbers, or one or two of stamps."""
        first = self.rows.first_fields()
        stamps = [k for k in range(self.table.width) if not is_number(first[k], self.table.decimal)
                  and clock.read_stamp(first[k]) is not None]  # fmt: skip
        if stamps:
            return stamps[:2], 1.0
        for k, factor in self._axes().items():
            return [k], factor
        if not self.table.names[0] and self._rises_evenly():
            return [0], 1.0
        return [], 1.0

    def _axes(self) -> dict[int, float]:
        """Columns of numbers that are times by their unit or name, and seconds per unit."""
        names, units, first = self.table.names, self.table.units, self.rows.first_fields()
        found = {}
        for k in range(self.table.width):
            unit = self.unit_s(units[k])
            key = key_of(names[k])
            if key in _INDEX or key_of(units[k]) in _INDEX or not is_number(first[k], self.table.decimal):
                continue
            if unit is not None or key in CLOCK_NAMES:
                found[k] = unit or CLOCK_NAMES[key]
            elif key in _TIMES:
                found[k] = unix_s(float(first[k].replace(",", ".")))
        return found

    def set_skews(self, recording: Recording, needed: list[int]) -> None:
        """How much later than the first axis of times each channel is sampled, which stands behind another axis.

        Raises InputError where that is more than a step, or changes: their samples do not belong together.
        """
        axes = self._axes()
        if len({self._axis_of(k, axes) for k in needed}) < 2:
            return
        seconds = self._rising(axes)
        own = {k: self._axis_of(k, seconds) for k in needed}
        reference = min(own.values())
        for k, axis in own.items():
            if axis == reference:
                continue
            first, later = seconds[reference], seconds[axis] - seconds[reference]
            step_s, later_s = float(first[-1] - first[0]) / (len(first) - 1), float(later.mean())
            if abs(later_s) > (1 + SAME_RATE) * step_s or np.abs(later - later_s).max() > step_s / 2:
                raise InputError(
                    self.rows.text.path,
                    f"the times in columns {reference + 1} and {axis + 1} are up to {np.abs(later).max():.3g} s apart, "
                    "expected channels of the same instants; put them on one time axis, or give --rate to take them as "
                    "they are",
                )
            recording.channels[k] = replace(recording.channels[k], skew_s=skew(later_s, step_s))

    @staticmethod
    def _axis_of(column: int, axes: Collection[int]) -> int:
        """The last axis of times before a column, or the first of all; -1 without one."""
        return max((axis for axis in axes if axis < column), default=min(axes, default=-1))

    def _rising(self, axes: dict[int, float]) -> dict[int, Floats]:
        """Times [s] in columns whose name or unit says that they are times, and that rise as those of samples do."""
        found = {}
        for k, factor in axes.items():
            try:
                seconds = self.rows.numbers(k) * factor
            except InputError:
                continue  # results that stand in some rows
            if (np.diff(seconds) >= 0).all() and seconds[-1] > seconds[0]:
                found[k] = seconds
        return found

    def _rises_evenly(self) -> bool:
        """Whether the first column, which has no name, rises as times in seconds do."""
        rows = [self.rows.split(line) for line in self.rows.head[self.table.first :] if line.strip()]
        texts = [row[0].replace(",", ".") if self.table.decimal == "," else row[0] for row in rows]
        if len(texts) < 10 or not all(is_number(one, ".") for one in texts):
            return False
        steps = np.diff(np.array([float(one) for one in texts]))
        slack = _EVEN * steps.mean() + 2 * self.rows.quantum(0)
        return bool(_TIME_STEPS_S[0] < steps.mean() < _TIME_STEPS_S[1] and np.abs(steps - steps.mean()).max() < slack)

    @staticmethod
    def unit_s(text: str) -> float | None:
        """Seconds per unit; None for units that are no time."""
        try:
            unit = unit_of(text)
        except UnknownUnitError:
            return None
        return unit.factor if unit is not None and unit.quantity == "t" else None

    def of_stamps(self, columns: list[int], given: ChannelMap, above: Clock) -> Clock:
        """Clock of stamps in one column, or of date and time in two; of coarse ones the start alone.

        `above`: what the lines above the table say.
        """
        seconds = np.fromiter(self._stamped(columns), dtype=np.float64)
        joined = " ".join(self.rows.first_fields()[k] for k in columns)
        first = clock.read_stamp(joined) or clock.read_stamp(self.rows.first_fields()[columns[-1]])
        assert first is not None
        start, notes = clock.start_of(first)
        places = len(self.rows.first_fields()[columns[-1]].replace(",", ".").rpartition(".")[2].rstrip("Zz "))
        has_fraction = "." in self.rows.first_fields()[columns[-1]].replace(",", ".")[-12:]
        quantum = 10.0 ** -(places if has_fraction and places <= 9 else 0)
        try:
            said = of_times(self.rows.text.path, seconds, quantum, given, self.table.first + 1)
        except InputError:
            period = 1 / above.rate if above.rate else 0.0
            lasts = float(seconds[-1] - seconds[0]) - (len(seconds) - 1) * period
            if not period or quantum < period or abs(lasts) > 2 * quantum:  # rows are missing, or the rate is wrong
                raise
            return Clock(above.rate, start, (*notes, "its stamps are coarse: the rate above the table counts"))
        return Clock(said.rate, start, (*notes, *said.notes), said.breaks)

    def _stamped(self, columns: list[int]) -> Iterator[float]:
        """Seconds since the first stamp."""
        base: clock.Stamp | None = None
        before = 0.0
        for number, fields in self.rows.fields():
            text = " ".join(fields[k] for k in columns if k < len(fields))
            stamp = clock.read_stamp(text) or clock.read_stamp(fields[columns[-1]] if columns[-1] < len(fields) else "")
            if stamp is None:
                raise InputError(self.rows.text.path, f"row {number}: {text!r} is no time like the rows before")
            base = base or stamp
            days = (stamp.days or 0) - (base.days or 0)
            value = days * 86_400.0 + stamp.seconds - base.seconds
            if stamp.days is None and value < before - 43_200:  # over midnight
                value += 86_400.0
            before = value
            yield value
