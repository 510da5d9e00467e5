"""The waveform that a recording's channels make."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.metering import StreamFormat
from acqd.metering.block import Codes
from acqd.metering.delay import delayed
from acqd.sources.recording import alternating, continuity, converter
from acqd.sources.recording.averaging import averaged
from acqd.sources.recording.channel import Recording
from acqd.sources.recording.line_voltages import star_voltages
from acqd.sources.recording.marks import Marks, marks_of
from acqd.sources.recording.nominal import nominal_of
from acqd.sources.recording.roles import roles_of
from acqd.sources.recording.selection import Selection, chosen, factor_of, mapped
from acqd.sources.recording.sizes import hints
from acqd.sources.recording.steps import Steps, steps_of
from acqd.sources.waveform import ChannelMap, Waveform, check_values, stream_format

_RATE_TOLERANCE = 1e-3
"""--rate may differ so much from the rate that the file itself says: more is a contradiction."""
_FEW = 32
"""Samples a cycle: below, harmonics beyond the 15th are unknown, and a row is 0.1 % less exact."""
_DIRECT = 1.0
"""A mean above the RMS of the alternating part: a direct voltage."""


def select(recording: Recording, given: ChannelMap) -> Selection:
    """The channels to meter. Raises InputError."""
    if given.columns is not None:
        return mapped(recording, given)
    return chosen(recording, roles_of(recording.channels))


def waveform_of(recording: Recording, given: ChannelMap) -> Waveform:
    """Codes where the file has codes of 16 bits, else volts and amperes. Raises InputError."""
    selection = select(recording, given)
    f_nominal = given.f_nominal or recording.f_nominal or nominal_of(recording, given, selection)
    recording, given = averaged(recording, given, f_nominal)
    rate, notes = _rate(recording, given, f_nominal)
    if not recording.samples:
        raise InputError(recording.path, "has no samples")
    notes = (*notes, *selection.notes)
    if selection.between_lines:
        return _of_lines(recording, given, selection, (rate, f_nominal), notes)
    order = [channel for pair in zip(selection.voltages, selection.currents, strict=True) for _, channel in pair]
    names = [(k, recording.channels[k].name) for k in order]
    by_name = given.columns is None and not recording.declared
    factors = [_factor(recording, given, selection, k, place) for place, k in enumerate(order)]
    skews = [recording.channels[k].skew_s for k in order]
    relative = [(skew - skews[0]) * rate for skew in skews]
    start = recording.start_utc_ns
    if start is not None:
        start += round(skews[0] * 1e9)
    if not any(relative) and (codes := _codes(recording, order)) is not None:
        scale = [column_scale * factor for column_scale, factor in zip(codes[1], factors, strict=True)]
        form = stream_format(recording.path, rate, scale, f_nominal, codes[0])
        notes = (*notes, *hints(names, codes[0], np.array(scale), (rate, f_nominal), by_name))
        return _finished(recording, codes[0], form, start, notes)
    first, last = _common(recording, relative)
    values = np.empty((last - first, len(order)))
    for place, (k, skew) in enumerate(zip(order, relative, strict=True)):
        values[:, place] = delayed(recording.column(k).physical(), skew, first, last)
    check_values(recording.path, values)
    _refuse_direct(recording, selection, values)
    notes = (*notes, *hints(names, values, np.array(factors), (rate, f_nominal), by_name))
    if start is not None:
        start += round(first * 1e9 / rate)
    return _finished(recording, values, stream_format(recording.path, rate, factors, f_nominal, values), start, notes)


def _factor(recording: Recording, given: ChannelMap, selection: Selection, channel: int, place: int) -> float:
    """V or A per unit of the file of the channel in this place: u, i, u, i ..."""
    key = f"{'ui'[place % 2]}{selection.currents[place // 2][0]}"
    return factor_of(recording, channel, key, given.i_scale if place % 2 else given.u_scale)


def _codes(recording: Recording, order: list[int]) -> tuple[NDArray[np.int16], list[float]] | None:
    """Codes [samples, channels] and their scales; None where a channel has none."""
    codes, scales = np.empty((recording.samples, len(order)), np.int16), []
    for place, k in enumerate(order):
        column = recording.column(k)
        plain = column.values.dtype == np.int16 and not column.offset and (recording.full_scale or column.scale > 0)
        steps = Steps(column.scale, 1, 0) if plain else steps_of(column)
        if steps is None or not (recording.full_scale or _plausible(column.scale)):
            return None
        scales.append(steps.into(codes[:, place], column.values))
        del column  # before the next channel is read
    return codes, scales


def _plausible(scale: float) -> bool:
    """Whether a scale may be that of a converter, in the unit of the file."""
    return 1e-7 < abs(scale) < 1e3


def _finished(
    recording: Recording,
    codes: Codes,
    form: StreamFormat,
    start: int | None,
    notes: tuple[str, ...],
    flags: frozenset[str] = frozenset(),
) -> Waveform:
    doubts = (
        *converter.remarks(recording.path, codes), *continuity.remarks(codes, form, recording.breaks),
        *alternating.remarks(codes, form),
    )  # fmt: skip
    marks = marks_of(codes, form.rate, form.f_nominal, form.scale)
    said = (*notes, *recording.notes, *_remarks(marks), *doubts)
    breaks = tuple(recording.breaks)
    return Waveform(recording.path.name, codes, form, start, recording.simulated, said, flags, breaks, marks)


_MEANINGS = {
    "invalid": "samples stay at one value for half a cycle or longer, as in a gap that was filled",
    "clipped": "samples are cut at the end of the measuring range: values are too small",
    "rollover": "codes go beyond 16 bits and come back at the other end: values are wrong",
    "saturated": "a current transformer is saturated by a mean of its primary: values are too small",
    "offset": "a voltage has a mean (offset-binary codes?): values are too large",
}


def _remarks(marks: Marks) -> tuple[str, ...]:
    """What the flags mean, once each."""
    named = sorted({flag for _, _, flags in marks for flag in flags})
    return tuple(f"flagged {flag}: {_MEANINGS[flag]}" for flag in named)


def _of_lines(
    recording: Recording,
    given: ChannelMap,
    selection: Selection,
    clock: tuple[float, float],
    notes: tuple[str, ...],
) -> Waveform:
    """Star voltages from voltages between lines; every row is flagged `derived`. `clock`: rate and nominal f."""
    skews_s = [recording.channels[k].skew_s for _, k in selection.keys]
    relative = [(skew_s - skews_s[0]) * clock[0] for skew_s in skews_s]
    first, last = _common(recording, relative)
    columns = [
        delayed(_values(recording, given, key, k), skew, first, last)
        for (key, k), skew in zip(selection.keys, relative, strict=True)
    ]
    pairs = len(selection.voltages)
    volts, amperes = np.column_stack(columns[:pairs]), np.column_stack(columns[pairs:])
    start = recording.start_utc_ns
    if start is not None:
        start += round((skews_s[0] + first / clock[0]) * 1e9)
    star = star_voltages(recording.path, [pair for pair, _ in selection.voltages], volts, amperes)
    values = np.empty((last - first, 6))
    values[:, 0::2], values[:, 1::2] = star, amperes
    check_values(recording.path, values)
    form = stream_format(recording.path, clock[0], [1.0] * 6, clock[1], values)
    names = ", ".join(recording.channels[k].name for _, k in selection.voltages)
    said = f"{names} are voltages between lines: star voltages are derived from them, and rows are flagged derived"
    return _finished(recording, values, form, start, (said, *notes), frozenset({"derived"}))


def _values(recording: Recording, given: ChannelMap, key: str, channel: int) -> Floats:
    factor = factor_of(recording, channel, key, given.u_scale if key[0] == "u" else given.i_scale)
    return recording.column(channel).physical() * factor


def _rate(recording: Recording, given: ChannelMap, f_nominal: float) -> tuple[float, tuple[str, ...]]:
    """Samples/s and remarks. Raises InputError where nobody says, and where --rate contradicts the file."""
    known = recording.rate
    if known is None and given.rate is None:
        raise InputError(
            recording.path, "says neither its sampling rate nor the times of its samples; give the rate with --rate"
        )
    rate = given.rate or known
    assert rate is not None
    notes: tuple[str, ...] = ()
    if known is not None and given.rate is not None and abs(given.rate / known - 1) > _RATE_TOLERANCE:
        notes = (
            f"--rate {given.rate:g} overrules the file, whose samples come at {known:.6g} per second "
            f"({100 * (given.rate / known - 1):+.1f} %): f and W follow --rate",
        )
    if rate < _FEW * f_nominal:
        highest = max(int(0.48 * rate / f_nominal), 1)
        notes += (f"{rate:g} samples/s show harmonics up to number {highest} at {f_nominal:g} Hz; the others are lost",)
    return rate, notes


def _common(recording: Recording, skews: list[float]) -> tuple[int, int]:
    """Samples at whose time every channel is known."""
    first = last = 0
    if all(map(math.isfinite, skews)):
        first, last = math.ceil(max(0.0, *skews)), recording.samples + math.floor(min(0.0, *skews))
    if first >= last:
        raise InputError(recording.path, "the skews of its channels are longer than the recording")
    if recording.breaks and first | (recording.samples - last):
        raise InputError(recording.path, "has pauses and channels with a skew; expected one or other")
    return first, last


def _refuse_direct(recording: Recording, selection: Selection, values: Floats) -> None:
    """A direct voltage among alternating ones is no phase, whatever its name says. Raises InputError."""
    volts = values[:, 0::2]
    mean = np.abs(volts.mean(axis=0))
    direct = mean > np.maximum(_DIRECT * volts.std(axis=0), 1e-9)
    if direct.any() and not direct.all():
        phase, channel = selection.voltages[int(np.argmax(direct))]
        raise InputError(
            recording.path,
            f"{recording.noun} {recording.channels[channel].name!r} for u{phase[0]} is a direct voltage, and the "
            f"others alternate; say which is u{phase[0]} with --map, or meter the other phases only",
        )
