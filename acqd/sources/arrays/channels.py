"""Named arrays of a file as the channels of a recording."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from acqd.errors import InputError
from acqd.sources.arrays.clock import set_clock, skews_of
from acqd.sources.arrays.contents import Contents, Signal, key_of, label_of, values_of
from acqd.sources.recording.channel import Channel, Column, Recording
from acqd.sources.recording.converter import may_be_codes
from acqd.sources.recording.label import readings
from acqd.sources.recording.units import UnknownUnitError, unit_of
from acqd.sources.waveform import ChannelMap, position

_CODES = "whole numbers"
"""Unit of what may be codes: it is unknown, so the channel is refused with what to type."""


def recording_of(path: Path, title: str, contents: Contents, given: ChannelMap, advice: str = "") -> Recording:
    """Channels and clock. Raises InputError where there are no arrays, or where their clock contradicts itself."""
    times = [signal for signal in contents.signals if signal.is_time]
    channels = [signal for signal in contents.signals if not signal.is_time and signal.length > 1]
    if not channels:
        held = ", ".join(sorted(contents.numbers)) or "nothing"
        more = f"; {'; '.join(contents.notes)}" if contents.notes else ""
        raise InputError(path, f"holds no arrays of samples (numbers: {held[:200]}){more}")
    chosen = _of_one_clock(channels, given)
    left = [signal.name for signal in channels if signal not in chosen]
    notes = list(contents.notes)
    if left:
        notes.append(f"other lengths or rates than {chosen[0].name} have {', '.join(left[:6])}: left out")
    length = chosen[0].length
    shown = [_channel(signal) for signal in chosen]
    used = _used(path, shown, given)
    if used and not given.rate:
        skews = skews_of(path, [chosen[k] for k in used], times, contents.numbers)
        for k, skew_s in zip(used, skews, strict=True):
            shown[k] = replace(shown[k], skew_s=skew_s)
    recording = Recording(
        path, title, shown, length, lambda k: _column(path, chosen[k]), None,
        notes=notes, noun="array", advice=advice,
    )  # fmt: skip
    set_clock(
        recording,
        [chosen[k] for k in used] or chosen,
        [one for one in times if one.length == length],
        contents.numbers,
        given,
    )
    recording.f_nominal = next((v for k, v in contents.numbers.items() if key_of(k) in ("fnominal", "fnom")), None)
    recording.simulated = bool(contents.numbers.get("simulated"))
    if given.u_scale is None and given.i_scale is None:
        whole = _are_whole(path, [chosen[k] for k in used])
        recording.channels = [
            replace(channel, unit=_CODES) if (whole and k in used) or _are_codes(path, signal) else channel
            for k, (channel, signal) in enumerate(zip(recording.channels, chosen, strict=True))
        ]
    return recording


def _are_codes(path: Path, signal: Signal) -> bool:
    """Integers without a unit, or with a factor that is not applied: V and A, or codes? Nobody says."""
    return (_has_no_unit(signal) or signal.unapplied) and _is_integer(path, signal)


def _are_whole(path: Path, signals: list[Signal]) -> bool:
    """Whether nothing but whole numbers without a unit is metered: MATLAB stores codes, too, as double numbers."""
    plain = all(_has_no_unit(one) and (one.scale, one.offset) == (1.0, 0.0) for one in signals)
    return bool(signals) and plain and may_be_codes([values_of(path, one) for one in signals])


def _has_no_unit(signal: Signal) -> bool:
    return not signal.unit and not label_of(signal.name)[1]


def _is_integer(path: Path, signal: Signal) -> bool:
    if signal.scale != 1.0 or not any(one.quantity for one in readings(signal.name)):
        return False
    return bool(values_of(path, signal).dtype.kind in "iu")


def _of_one_clock(channels: list[Signal], given: ChannelMap) -> list[Signal]:
    """The largest set of channels with one length and step; that of the --map where it names channels."""
    named = set((given.columns or {}).values())
    counted: Counter[tuple[int, float | None]] = Counter()
    for signal in channels:
        counted[signal.length, signal.step_s] += 1 + 1000 * (signal.name in named)
    best = max(counted, key=lambda one: (counted[one], one[0]))
    return [signal for signal in channels if (signal.length, signal.step_s) == best]


def _used(path: Path, channels: list[Channel], given: ChannelMap) -> list[int]:
    """Numbers of the channels that may be metered: those of the --map, else those that are voltages or currents."""
    if given.columns:
        names = [channel.name for channel in channels]
        return [position(path, names, column, "array") for column in given.columns.values()]
    return [k for k, one in enumerate(channels) if _quantity(one) in ("u", "i")]


def _quantity(channel: Channel) -> str:
    """By the unit, else by the name; empty where neither says so."""
    try:
        unit = unit_of(channel.unit)
    except UnknownUnitError:
        return ""
    return unit.quantity if unit else next((one.quantity for one in readings(channel.name) if one.quantity), "")


def _channel(signal: Signal) -> Channel:
    name, unit = label_of(signal.name)
    return Channel(signal.name if signal.unit else name, signal.unit or unit)


def _column(path: Path, signal: Signal) -> Column:
    values = values_of(path, signal)
    if values.dtype.kind not in "iuf" or values.shape != (signal.length,):
        raise InputError(path, f"{signal.name} is {values.dtype} {values.shape}; expected {signal.length} numbers")
    if values.dtype.kind == "f" and values.dtype.itemsize > 8:
        values = values.astype(np.float64)
    return Column(values, signal.scale, signal.offset)
