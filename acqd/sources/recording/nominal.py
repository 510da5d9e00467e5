"""The nominal frequency of a recording that does not say it, from its first voltage."""

from __future__ import annotations

import numpy as np

from acqd.errors import InputError
from acqd.metering.block import NOMINAL
from acqd.sources.recording.channel import Recording
from acqd.sources.recording.selection import Selection
from acqd.sources.waveform import ChannelMap

_NAMES = (50 / 3, 50.0, 400.0)
"""Of the ranges of `NOMINAL`; 60 Hz is metered as 50 Hz is."""
_LONGEST_S = 1.0
_MOST = 1 << 16
"""Samples that are looked at: a spectrum takes a hundred bytes for each."""
_SHARE = 0.5
"""Of the alternating power, that the line of the mains has at least."""


def nominal_of(recording: Recording, given: ChannelMap, selection: Selection) -> float:
    """16 2/3 or 400 Hz where the strongest line of the voltage is near them; else 50 Hz."""
    rate = given.rate or recording.rate
    if not rate or not recording.samples:
        return 50.0
    try:
        column = recording.column(selection.voltages[0][1])
    except InputError:
        return 50.0  # raised again where the samples are needed
    u = column.values[: round(min(_LONGEST_S * rate, _MOST))].astype(np.float64)
    if len(u) < min(rate / 10, _MOST) or not np.isfinite(u).all():
        return 50.0
    power = np.abs(np.fft.rfft((u - u.mean()) * np.hanning(len(u)))) ** 2
    f = np.fft.rfftfreq(len(u), 1 / rate)
    strongest = f[np.argmax(power)]
    near = power[np.abs(f - strongest) < 20 / (len(u) / rate)].sum()
    if near < _SHARE * power.sum():
        return 50.0
    return next((name for (low, high), name in zip(NOMINAL, _NAMES, strict=True) if low <= strongest <= high), 50.0)
