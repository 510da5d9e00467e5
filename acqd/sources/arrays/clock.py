"""The clock of arrays: a step that the format states, a rate or step among the numbers, or an array of times.

A converter with a multiplexer samples its channels one after the other: starts and axes of times that stand beside the
arrays say how much later.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.arrays.contents import Signal, key_of, values_of
from acqd.sources.recording.channel import Recording
from acqd.sources.recording.clock import of_times, unix_s
from acqd.sources.recording.siblings import skew
from acqd.sources.recording.units import UnknownUnitError, split_label, unit_of
from acqd.sources.waveform import LATEST_NS, ChannelMap

_RATES = {"fs", "rate", "samplerate", "samplingrate", "samplingfrequency", "samplefrequency", "frequencyofsampling",
          "sampfreq", "abtastrate", "sr"}  # fmt: skip
_STEPS = {"dt", "ts", "tinterval", "sampleinterval", "samplinginterval", "samplingperiod", "sampletime", "increment",
          "xincrement", "deltat", "timestep"}  # fmt: skip
_DATES = {"start_utc_ns"}
_STARTS = {"t0", "tstart", "tzero", "start", "starttime", "timestart", "xzero", "xstart", "timeoffset"}
"""Time of the first sample of one array [s]."""
_SAME_RATE = 1e-3


def set_clock(
    recording: Recording, chosen: list[Signal], times: list[Signal], numbers: dict[str, float], given: ChannelMap
) -> None:
    """Rate and start: of the format, of an array of times, of a number."""
    path, said = recording.path, None if given.rate else _rate_of_numbers(recording.path, numbers)
    start = next((v for k, v in numbers.items() if k.lower() in _DATES), None)
    if start is not None and 1e16 <= start < LATEST_NS:
        recording.start_utc_ns = int(start)
    if chosen[0].step_s:
        recording.rate, recording.start_utc_ns = 1 / chosen[0].step_s, chosen[0].start_utc_ns
        return
    if not times:
        recording.rate = said
        return
    seconds, quantum, stamped = _seconds(path, times[0])
    clock = of_times(path, seconds, quantum, given, 0)
    recording.rate, recording.notes = clock.rate, [*recording.notes, *clock.notes]
    recording.breaks = list(clock.breaks)
    if recording.start_utc_ns is None:
        recording.start_utc_ns = stamped if stamped is not None else clock.start_utc_ns
    if said and clock.rate and abs(said / clock.rate - 1) > _SAME_RATE:
        recording.notes.append(
            f"its numbers say {said:g} samples/s, its times {clock.rate:.6g}: the times count; --rate overrules both"
        )


def skews_of(path: Path, chosen: list[Signal], times: list[Signal], numbers: dict[str, float]) -> list[float]:
    """How much later than the first channel each one is sampled [s], by the starts or axes of times that stand beside.

    A converter with a multiplexer samples within a step. Raises InputError for channels that are farther apart.
    """
    beside = [one for one in times if _owner(one.name) and one.length == chosen[0].length]
    axes = {one.name: axis for one in beside if (axis := _axis(path, one)) is not None}
    known = [_begin(signal, axes, numbers) for signal in chosen]
    said = _rate_of_numbers(path, numbers)
    axis_s = next((each.step_s for each in known if each and each.step_s), None)
    step_s = axis_s or chosen[0].step_s or (1 / said if said else None)
    skews = [0.0] * len(chosen)
    if not step_s:
        return skews
    for kind in dict.fromkeys(each.kind for each in known if each):
        alike = [(k, each) for k, each in enumerate(known) if each and each.kind == kind]
        first = alike[0][1]
        for k, each in alike[1:]:
            later_s, rounding_s = each.second - first.second, 4 * float(np.spacing(abs(first.second)))
            if abs(later_s) > (1 + _SAME_RATE) * step_s + rounding_s:
                early, late = (first, each) if later_s > 0 else (each, first)
                raise InputError(
                    path,
                    f"{late.name} begins {abs(later_s):.3g} s after {early.name}, expected channels of the same "
                    "instants; choose others with --map, or put them on one time axis (--rate takes them as they are)",
                )
            skews[k] = skew(later_s, step_s) if abs(later_s) > rounding_s else 0.0
    return skews


class _Begin(NamedTuple):
    """When an array begins, of those of one kind."""

    name: str
    second: float
    kind: str
    """What the second counts from: `utc` where it is the format's, `dates`, `axis`, `number`."""
    step_s: float | None = None
    """Of the axis of times."""


def _axis(path: Path, signal: Signal) -> _Begin | None:
    """Of an array of times; None where it does not rise as the times of samples do."""
    try:
        seconds, _, begun = _seconds(path, signal)
    except InputError:
        return None  # the clock's own axis is judged elsewhere
    if (np.diff(seconds) < 0).any() or not seconds[-1] > seconds[0]:
        return None
    kind, second = ("axis", float(seconds[0])) if begun is None else ("dates", begun * 1e-9)
    return _Begin(signal.name, second, kind, float(seconds[-1] - seconds[0]) / (len(seconds) - 1))


def _begin(signal: Signal, axes: dict[str, _Begin], numbers: dict[str, float]) -> _Begin | None:
    """By the format, by the axis of times or the number in the same group or struct; None where nothing says so."""
    if signal.start_utc_ns is not None:
        return _Begin(signal.name, signal.start_utc_ns * 1e-9, "utc")
    axis = next((name for name in axes if signal.name.startswith(f"{_owner(name)}/")), None)
    if axis is not None:
        return axes[axis]
    for label, value in numbers.items():
        name, unit = split_label(label.rpartition("/")[2])
        if key_of(name) in _STARTS and _owner(label) and f"{signal.name}/".startswith(f"{_owner(label)}/"):
            return _Begin(label, value * (_step_unit(unit) if unit else unix_s(value)), "number")
    return None


def _owner(label: str) -> str:
    """Group, struct or array that a number or an array of times belongs to."""
    return label.rpartition("/")[0]


def _seconds(path: Path, signal: Signal) -> tuple[Floats, float, int | None]:
    """An array of times [s], their resolution [s], and the UTC of the first one where the array holds dates."""
    values = values_of(path, signal)
    if values.dtype.kind in "mM":
        ns = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
        if (ns == np.iinfo(np.int64).min).any():
            raise InputError(path, f"{signal.name} has times that are missing")
        return (ns - ns[0]) * 1e-9, 1e-9, int(ns[0]) if values.dtype.kind == "M" else None
    if values.dtype.kind not in "iuf":
        raise InputError(path, f"{signal.name} is {values.dtype}; expected times")
    seconds = values.astype(np.float64) * signal.seconds
    if not np.isfinite(seconds).all():
        raise InputError(path, f"{signal.name} has times that are no numbers")
    largest = np.abs(values).max()
    quantum = np.spacing(largest) if values.dtype.kind == "f" else 1
    return seconds, float(quantum) * signal.seconds, None


def _rate_of_numbers(path: Path, numbers: dict[str, float]) -> float | None:
    """Samples/s of a number such as `fs`, `SampleRate_Hz`, `dt`. Raises InputError for several that disagree."""
    found = {}
    for label, value in numbers.items():
        name, unit = split_label(label.rpartition("/")[2])
        key = key_of(name)
        factor = {"khz": 1e3, "mhz": 1e6, "ks/s": 1e3}.get(unit.lower(), 1.0)
        if key in _RATES and value > 0:
            found[label] = value * factor
        elif key in _STEPS and value > 0:
            found[label] = 1 / (value * _step_unit(unit))
    rates = list(found.values())
    if rates and max(rates) > (1 + _SAME_RATE) * min(rates):
        listed = ", ".join(f"{label} {rate:g}/s" for label, rate in found.items())
        raise InputError(path, f"says several sampling rates ({listed}); choose one with --rate")
    return rates[0] if rates else None


def _step_unit(text: str) -> float:
    try:
        unit = unit_of(text)
    except UnknownUnitError:
        return 1.0
    return unit.factor if unit is not None and unit.quantity == "t" else 1.0
