"""The table of a text export that has been found: its channels, samples, clock."""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.recording.channel import Channel, Column, Recording
from acqd.sources.recording.clock import Clock, of_times
from acqd.sources.recording.converter import are_whole, may_be_codes
from acqd.sources.recording.siblings import skew
from acqd.sources.recording.units import CLOCK_NAMES, TIME_NAMES, UnknownUnitError, unit_of
from acqd.sources.text import clock
from acqd.sources.text.layout import Layout, key_of
from acqd.sources.text.table import HEAD_LINES, Table, factors, is_number, split_row
from acqd.sources.waveform import ChannelMap

_HEAD_BYTES = 1 << 20
_SAME_RATE = 5e-3  # how far the rate above a table may be from that of its times: increments are printed with 3 digits
_EVEN = 0.01
"""Of a step: how far the steps of a column without a name may be from each other to be those of times."""
_TIME_STEPS_S = (1e-8, 5e-3)
_CODE_SCALE = re.compile(r"verticalscale|voltsdiv|voltsperdiv|vertscale|vscale")
"""Lines of oscilloscopes that say V for a division: beside whole numbers these are codes of the converter."""
_INDEX = ("sequence", "index", "sample", "samples", "no", "nr", "n", "point", "points", "number", "xindex")
_TIMES = (*(key_of(name) for name in TIME_NAMES), "xvalue", "timesec", "timeaxis", "abstime", "reltime")


class Text:
    """The lines of a file, read again by every method: never all of them in memory."""

    def __init__(self, path: Path, encoding: str) -> None:
        self.path, self._encoding = path, encoding
        self.torn = False
        """Whether the last line is left out: nobody ended it."""

    def ends_torn(self) -> bool:
        """Whether the last line has no end."""
        with self.path.open("rb") as file:
            wide = 2 if self._encoding.lower().startswith("utf-16") else 1
            file.seek(-wide, 2)
            return file.read(wide).strip(b"\0") not in (b"\r", b"\n")

    def head(self) -> list[str]:
        """The first lines."""
        lines, size = [], 0
        for line in islice(self.lines(), HEAD_LINES):
            size += len(line)
            if size > _HEAD_BYTES:
                break
            lines.append(line)
        if not lines:
            raise InputError(self.path, "is empty")
        return lines

    def lines(self) -> Iterator[str]:
        """All lines. Raises InputError for bytes that are no text."""
        try:
            with self.path.open(encoding=self._encoding) as file:
                last = ""
                for line in file:
                    if last:
                        yield last
                    last = line
                if last and not self.torn:
                    yield last
        except UnicodeError:
            raise InputError(self.path, f"is not text in {self._encoding}; give its encoding with --encoding") from None


@dataclass(slots=True)
class Export:
    """One file whose table has been found."""

    text: Text
    layout: Layout
    table: Table
    head: list[str]
    values: dict[int, Floats] = field(default_factory=dict)
    recorded: Recording = field(init=False)
    lone: int | None = None
    """The only column beside the time."""
    begin_s: float = 0.0
    """First time of a column of times."""

    def recording(self) -> Recording:
        """Its channels; samples and clock come with `read`."""
        inputs = [re.compile(one) for one in self.layout.inputs]
        channels = [
            Channel(name, unit, input=name == f"column {k}" or any(one.search(name) for one in inputs))
            for k, (name, unit) in enumerate(zip(self.table.names, self.table.units, strict=True))
        ]
        title = self.layout.title
        return Recording(self.text.path, title, channels, 0, self.column, None, advice=self.layout.advice)

    def read(self, recording: Recording, needed: list[int], given: ChannelMap) -> None:
        """Read the columns that are metered, and the clock. Raises InputError, which names row and column."""
        times, factor = self._time_columns()
        beside = [k for k in range(self.table.width) if k not in times]
        self.lone = beside[0] if len(beside) == 1 else None
        numeric = len(times) == 1 and is_number(self._first_fields()[times[0]], self.table.decimal)
        wanted = sorted({*needed, *(times if numeric else ())})
        if not wanted:
            wanted = [k for k, one in enumerate(self._first_fields()) if is_number(one, self.table.decimal)][:1]
        self._load(wanted)
        recording.samples = len(self.values[wanted[0]])
        if not recording.samples:
            raise InputError(self.text.path, "has a header but no samples")
        self._refuse_codes(needed, given)
        if not given.rate:
            self._set_skews(recording, needed)
        found = clock.of_preamble(self.text.path, self.table, self.layout)
        if numeric:
            column = self.values.pop(times[0]) if times[0] not in needed else self.values[times[0]]
            self.begin_s = float(column[0]) * factor
            said = of_times(
                self.text.path, column * factor, self._quantum(times[0]) * factor, given, self.table.first + 1
            )
            start = said.start_utc_ns if said.start_utc_ns is not None else found.start_utc_ns
            doubt = () if given.rate else self._other_rate(found.rate, said.rate, times[0])
            found = Clock(said.rate, start, (*found.notes, *said.notes, *doubt), said.breaks)
        elif times:
            found = self._of_stamps(times, given, found)
        recording.rate, recording.start_utc_ns, recording.breaks = found.rate, found.start_utc_ns, list(found.breaks)
        recording.notes += found.notes
        recording.notes += [
            f"its header has a factor that is not applied: {text} (--u-scale and --i-scale apply one)"
            for text in factors(self.table)
        ]
        if self.text.torn:
            recording.notes.append("its last row is cut off: left out")
        if self.table.started:
            recording.notes.append(
                f"rows without a number in each channel at its beginning: {self.table.started} left out"
            )
        rows = clock.announced(self.table, self.layout)
        if rows and rows != recording.samples:
            recording.notes.append(f"its header announces {rows} rows, the table has {recording.samples} (cut off?)")

    def _other_rate(self, above: float | None, column: float | None, k: int) -> tuple[str, ...]:
        """A remark where lines above the table say another rate than the column of times, which holds if it has a unit.

        Raises InputError where it has none: either may be right.
        """
        if not above or not column or abs(above / column - 1) < _SAME_RATE:
            return ()
        said = f"its header says {above:g} samples/s, its time column {column:g}"
        if self._time_unit(self.table.units[k]) is None:
            raise InputError(self.text.path, f"{said}; name the unit of the times, like time [ms], or give --rate")
        return (f"{said}, which holds (--rate overrules it)",)

    def column(self, number: int) -> Column:
        """Samples of one column."""
        if number not in self.values:
            self._load([number])
        return Column(self.values[number])

    def _first_fields(self) -> list[str]:
        fields = self._split(self.head[self.table.first])
        return [*fields, *[""] * (self.table.width - len(fields))]

    def _split(self, line: str) -> list[str]:
        """Fields of the table in a line."""
        fields = split_row(line, self.table.separator)
        if self.layout.columns:
            fields = [fields[k] if k < len(fields) else "" for k in self.layout.columns]
        return fields

    def _time_columns(self) -> tuple[list[int], float]:
        """Columns that tell the time, and seconds per unit: one of numbers, or one or two of stamps."""
        first = self._first_fields()
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
        names, units, first = self.table.names, self.table.units, self._first_fields()
        found = {}
        for k in range(self.table.width):
            unit = self._time_unit(units[k])
            key = key_of(names[k])
            if key in _INDEX or key_of(units[k]) in _INDEX or not is_number(first[k], self.table.decimal):
                continue
            if unit is not None or key in _TIMES or key in CLOCK_NAMES:
                found[k] = unit or CLOCK_NAMES.get(key, 1.0)
        return found

    def _set_skews(self, recording: Recording, needed: list[int]) -> None:
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
            if abs(later_s) > (1 + _SAME_RATE) * step_s or np.abs(later - later_s).max() > step_s / 2:
                raise InputError(
                    self.text.path,
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
            known = k in self.values
            if not known:
                try:
                    self._load([k])
                except InputError:
                    continue  # results that stand in some rows
            seconds = (self.values[k] if known else self.values.pop(k)) * factor
            if (np.diff(seconds) >= 0).all() and seconds[-1] > seconds[0]:
                found[k] = seconds
        return found

    def _rises_evenly(self) -> bool:
        """Whether the first column, which has no name, rises as times in seconds do."""
        rows = [self._split(line) for line in self.head[self.table.first :] if line.strip()]
        texts = [row[0].replace(",", ".") if self.table.decimal == "," else row[0] for row in rows]
        if len(texts) < 10 or not all(is_number(one, ".") for one in texts):
            return False
        steps = np.diff(np.array([float(one) for one in texts]))
        slack = _EVEN * steps.mean() + 2 * self._quantum(0)
        return bool(_TIME_STEPS_S[0] < steps.mean() < _TIME_STEPS_S[1] and np.abs(steps - steps.mean()).max() < slack)

    def _time_unit(self, text: str) -> float | None:
        """Seconds per unit; None for units that are no time."""
        try:
            unit = unit_of(text)
        except UnknownUnitError:
            return None
        return unit.factor if unit is not None and unit.quantity == "t" else None

    def _quantum(self, column: int) -> float:
        """Step in which a column of times is printed, from the first rows."""
        digits = 0
        for line in self.head[self.table.first : self.table.first + 100]:
            fields = self._split(line)
            if column < len(fields):
                mantissa, _, exponent = fields[column].lower().partition("e")
                places = len(mantissa.replace(",", ".").partition(".")[2])
                digits = max(digits, places - (int(exponent) if exponent.lstrip("+-").isdigit() else 0))
        return 10.0**-digits

    def _refuse_codes(self, needed: list[int], given: ChannelMap) -> None:
        """Raises InputError for whole numbers in all channels, without a unit or beside volts per division."""
        if not needed or given.u_scale is not None or given.i_scale is not None:
            return
        columns = [self.values[k] for k in needed]
        if not are_whole(columns):
            return
        scaled = next((key for key in self.table.preamble if _CODE_SCALE.search(key)), "")
        if scaled and all(np.gcd.reduce(one.astype(np.int64)) == 1 for one in columns):
            raise InputError(
                self.text.path,
                f"its channels hold whole numbers beside {scaled!r}, as codes of a converter; export volts (GW "
                "Instek: Detail), or say with --u-scale and --i-scale what a code is (vertical scale / 25)",
            )
        if not any(self.table.units[k] for k in needed) and may_be_codes(columns):
            raise InputError(
                self.text.path,
                "its channels hold whole numbers and no unit, as codes of a converter or mV; say with --u-scale and "
                "--i-scale how many V and A one is (--u-scale 1 --i-scale 1 where they are V and A)",
            )

    def _of_stamps(self, columns: list[int], given: ChannelMap, above: Clock) -> Clock:
        """Clock of stamps in one column, or of date and time in two; of coarse ones the start alone.

        `above`: what the lines above the table say.
        """
        seconds = np.fromiter(self._stamped(columns), dtype=np.float64)
        joined = " ".join(self._first_fields()[k] for k in columns)
        first = clock.read_stamp(joined) or clock.read_stamp(self._first_fields()[columns[-1]])
        assert first is not None
        start, notes = clock.start_of(first)
        places = len(self._first_fields()[columns[-1]].replace(",", ".").rpartition(".")[2].rstrip("Zz "))
        has_fraction = "." in self._first_fields()[columns[-1]].replace(",", ".")[-12:]
        quantum = 10.0 ** -(places if has_fraction and places <= 9 else 0)
        try:
            said = of_times(self.text.path, seconds, quantum, given, self.table.first + 1)
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
        for number, fields in self._fields():
            text = " ".join(fields[k] for k in columns if k < len(fields))
            stamp = clock.read_stamp(text) or clock.read_stamp(fields[columns[-1]] if columns[-1] < len(fields) else "")
            if stamp is None:
                raise InputError(self.text.path, f"row {number}: {text!r} is no time like the rows before")
            base = base or stamp
            days = (stamp.days or 0) - (base.days or 0)
            value = days * 86_400.0 + stamp.seconds - base.seconds
            if stamp.days is None and value < before - 43_200:  # over midnight
                value += 86_400.0
            before = value
            yield value

    def _fields(self) -> Iterator[tuple[int, list[str]]]:
        for number, line in enumerate(self.text.lines(), start=1):
            if number > self.table.first and line.strip():
                yield number, self._split(line)

    def _load(self, columns: list[int]) -> None:
        """Numbers of some columns. Raises InputError, which names row and column of anything else."""
        places = [self.layout.columns[k] for k in columns] if self.layout.columns else columns
        delimiter = {" ": None, ",": ";" if self._quoted else ","}.get(self.table.separator, self.table.separator)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that there are no rows
                found = np.loadtxt(self._rows(), delimiter=delimiter, usecols=places, ndmin=2, comments=None)
        except (ValueError, IndexError):
            fault = self._first_fault(columns)
            if self.values or self.text.torn or not self.text.ends_torn():  # columns have equally many rows
                raise InputError(self.text.path, fault) from None
            self.text.torn = True  # a logger that lost its supply
            try:
                self._load(columns)
            except InputError:
                raise InputError(self.text.path, fault) from None
            return
        bad = np.argwhere(~np.isfinite(found))
        if len(bad):
            row, column = bad[0]
            raise InputError(
                self.text.path,
                f"row {row + self.table.first + 1}, column {columns[column] + 1}: {found[row, column]} is not a number",
            )
        for k, column in enumerate(columns):
            self.values[column] = found[:, k]

    @property
    def _quoted(self) -> bool:
        """Whether quotes alone tell decimal commas from separators."""
        return self.table.separator == self.table.decimal

    def _rows(self) -> Iterator[str]:
        comma = self.table.decimal == ","
        for line in islice(self.text.lines(), self.table.first, None):
            if line.strip():
                if self._quoted:
                    line = ";".join(split_row(line, self.table.separator))
                row = line.replace('"', "")
                yield row.replace(",", ".") if comma else row

    def _first_fault(self, columns: list[int]) -> str:
        """Which row and column is not as the first rows promise."""
        for number, fields in self._fields():
            if len(fields) < max(columns) + 1 or (fields and not any(fields)):
                return (
                    f"row {number} has {len(fields)} columns, expected {self.table.width} as in the header (cut off?)"
                )
            for k in columns:
                if "∞" in fields[k]:
                    return f"row {number}, column {k + 1}: {fields[k]!r} is beyond the range of the instrument"
                if not is_number(fields[k], self.table.decimal):
                    sign = " (decimal sign?)" if any(c in fields[k] for c in ".,") else ""
                    return f"row {number}, column {k + 1}: {fields[k]!r} is not a number{sign}"
        return "is not a table of numbers"
