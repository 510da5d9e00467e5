"""The table of a text export that has been found: its channels, samples, clock."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from acqd.errors import InputError
from acqd.sources.recording.channel import Channel, Column, Recording
from acqd.sources.recording.clock import Clock, of_times
from acqd.sources.recording.converter import are_whole, may_be_codes
from acqd.sources.text import clock
from acqd.sources.text.rows import Rows
from acqd.sources.text.table import factors, is_number
from acqd.sources.text.times import SAME_RATE, Times
from acqd.sources.waveform import ChannelMap

_CODE_SCALE = re.compile(r"verticalscale|voltsdiv|voltsperdiv|vertscale|vscale")
"""Lines of oscilloscopes that say V for a division: beside whole numbers these are codes of the converter."""


@dataclass(slots=True)
class Export:
    """One file whose table has been found."""

    rows: Rows
    recorded: Recording = field(init=False)
    lone: int | None = None
    """The only column beside the time."""
    begin_s: float = 0.0
    """First time of a column of times."""

    def recording(self) -> Recording:
        """Its channels; samples and clock come with `read`."""
        table, layout = self.rows.table, self.rows.layout
        inputs = [re.compile(one) for one in layout.inputs]
        channels = [
            Channel(name, unit, input=name == f"column {k}" or any(one.search(name) for one in inputs))
            for k, (name, unit) in enumerate(zip(table.names, table.units, strict=True))
        ]
        return Recording(self.rows.text.path, layout.title, channels, 0, self.column, None, advice=layout.advice)

    def column(self, number: int) -> Column:
        """Samples of one column."""
        return Column(self.rows.numbers(number))

    def read(self, recording: Recording, needed: list[int], given: ChannelMap) -> None:
        """Read the columns that are metered, and the clock. Raises InputError, which names row and column."""
        rows, table, path = self.rows, self.rows.table, self.rows.text.path
        times = Times(rows)
        axes, factor = times.columns()
        beside = [k for k in range(table.width) if k not in axes]
        self.lone = beside[0] if len(beside) == 1 else None
        first = rows.first_fields()
        numeric = len(axes) == 1 and is_number(first[axes[0]], table.decimal)
        wanted = sorted({*needed, *(axes if numeric else ())})
        if not wanted:
            wanted = [k for k, one in enumerate(first) if is_number(one, table.decimal)][:1]
        rows.load(wanted)
        recording.samples = len(rows.numbers(wanted[0]))
        if not recording.samples:
            raise InputError(path, "has a header but no samples")
        self._refuse_codes(needed, given)
        if not given.rate:
            times.set_skews(recording, needed)
        found = clock.of_preamble(path, table, rows.layout)
        if numeric:
            seconds = rows.numbers(axes[0]) * factor
            self.begin_s = float(seconds[0])
            said = of_times(path, seconds, rows.quantum(axes[0]) * factor, given, table.first + 1)
            start = said.start_utc_ns if said.start_utc_ns is not None else found.start_utc_ns
            doubt = () if given.rate else self._other_rate(found.rate, said.rate, axes[0])
            found = Clock(said.rate, start, (*found.notes, *said.notes, *doubt), said.breaks)
        elif axes:
            found = times.of_stamps(axes, given, found)
        for axis in {*axes} - {*needed}:
            rows.forget(axis)
        recording.rate, recording.start_utc_ns, recording.breaks = found.rate, found.start_utc_ns, list(found.breaks)
        recording.notes += [*found.notes, *self._remarks(recording.samples)]

    def _remarks(self, samples: int) -> list[str]:
        """What the lines around the table say, and what is left out."""
        table, text = self.rows.table, self.rows.text
        said = [
            f"its header has a factor that is not applied: {one} (--u-scale and --i-scale apply one)"
            for one in factors(table)
        ]
        if text.torn:
            said.append("its last row is cut off: left out")
        if below := [line.strip() for line in text.below if line.strip()]:
            said.append(f"lines below its table: {len(below)} left out ({below[0][:40]!r})")
        if table.started:
            said.append(f"rows without a number in each channel at its beginning: {table.started} left out")
        announced = clock.announced(table, self.rows.layout)
        if announced and announced != samples:
            said.append(f"its header announces {announced} rows, the table has {samples} (cut off?)")
        return said

    def _other_rate(self, above: float | None, column: float | None, k: int) -> tuple[str, ...]:
        """A remark where lines above the table say another rate than the column of times, which holds if it has a unit.

        Raises InputError where it has none: either may be right.
        """
        if not above or not column or abs(above / column - 1) < SAME_RATE:
            return ()
        said = f"its header says {above:g} samples/s, its time column {column:g}"
        if Times.unit_s(self.rows.table.units[k]) is None:
            raise InputError(self.rows.text.path, f"{said}; name the unit of the times, like time [ms], or give --rate")
        return (f"{said}, which holds (--rate overrules it)",)

    def _refuse_codes(self, needed: list[int], given: ChannelMap) -> None:
        """Raises InputError for whole numbers in all channels, without a unit or beside volts per division."""
        if not needed or given.u_scale is not None or given.i_scale is not None:
            return
        table, path = self.rows.table, self.rows.text.path
        columns = [self.rows.numbers(k) for k in needed]
        if not are_whole(columns):
            return
        scaled = next((key for key in table.preamble if _CODE_SCALE.search(key)), "")
        if scaled and all(np.gcd.reduce(one.astype(np.int64)) == 1 for one in columns):
            raise InputError(
                path,
                f"its channels hold whole numbers beside {scaled!r}, as codes of a converter; export volts (GW "
                "Instek: Detail), or say with --u-scale and --i-scale what a code is (vertical scale / 25)",
            )
        if not any(table.units[k] for k in needed) and may_be_codes(columns):
            raise InputError(
                path,
                "its channels hold whole numbers and no unit, as codes of a converter or mV; say with --u-scale and "
                "--i-scale how many V and A one is (--u-scale 1 --i-scale 1 where they are V and A)",
            )
