"""Recordings of oscilloscopes that are faster than the meter: means of consecutive samples.

A mean over k samples of a mains wave of f is too small by the factor sinc(pi f k / rate): below 1e-7 at the rates that
are left. Power of the switching frequencies above half the new rate is lost.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from acqd.errors import InputError
from acqd.sources.recording.channel import Column, Recording
from acqd.sources.waveform import ChannelMap

FASTEST = 1e6
"""Samples/s that the meter takes at 50 and 60 Hz."""
_INTEGERS = {8: np.int16, 16: np.int32}
"""Bits of codes, and integers that hold the sum of `_MOST` of them."""
_MOST = 128
"""Samples whose sums stay integers."""


def averaged(recording: Recording, given: ChannelMap, f_nominal: float) -> tuple[Recording, ChannelMap]:
    """Both as they are, or with means where the rate is above `FASTEST` at 50 Hz, in proportion below.

    Raises InputError for less than a cycle: times in another unit look like a fast recording.
    """
    rate, fastest = given.rate or recording.rate, FASTEST * min(1.0, f_nominal / 50.0)
    if rate is None or not fastest < rate < math.inf:
        return recording, given
    if recording.samples < rate / f_nominal:
        raise InputError(
            recording.path,
            f"lasts {recording.samples / rate:.3g} s at {rate:.4g} samples/s, less than a cycle of the mains; are its "
            "times in ms, us or days? Say the unit in the name, like time [ms], or give --rate",
        )
    size = math.ceil(rate / fastest)
    note = f"{rate:g} samples/s: means of {size} samples are metered, {rate / size:g} per second"
    start = recording.start_utc_ns
    means = replace(
        recording,
        samples=recording.samples // size,
        column=lambda k: _means(recording.column(k), size),
        rate=None if recording.rate is None else recording.rate / size,
        start_utc_ns=None if start is None else start + round((size - 1) / 2 / rate * 1e9),
        notes=[*recording.notes, note],
        breaks=[(at // size, max(1, lost // size)) for at, lost in recording.breaks],
    )
    return means, given if given.rate is None else replace(given, rate=given.rate / size)


def _means(column: Column, size: int) -> Column:
    """Of codes: their sums, which are codes as well, with a scale that is smaller; else of values."""
    values = column.values
    whole = len(values) // size * size
    kind = _INTEGERS.get(8 * values.dtype.itemsize) if values.dtype.kind in "iu" and size <= _MOST else None
    if kind is None:
        return Column(column.physical()[:whole].reshape(-1, size).mean(axis=1))
    sums = np.zeros(whole // size, kind)
    for k in range(size):
        sums += values[k:whole:size]
    return Column(sums, column.scale / size, column.offset)
