"""Named arrays and numbers of a file as a recording: which array is the time, which are the channels.

Nobody says in such a file which array is what. The names and units decide as in any recording; the clock is a step that
the format states, a sampling rate or step among the numbers, or an array of times.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.recording.channel import Channel, Column, Recording
from acqd.sources.recording.clock import of_times
from acqd.sources.recording.label import readings
from acqd.sources.recording.siblings import skew
from acqd.sources.recording.units import TIME_NAMES, UnknownUnitError, split_label, unit_of
from acqd.sources.waveform import LATEST_NS, MOST_BYTES, ChannelMap, position

_RATES = {"fs", "rate", "samplerate", "samplingrate", "samplingfrequency", "samplefrequency", "frequencyofsampling",
          "sampfreq", "abtastrate", "sr"}  # fmt: skip
_STEPS = {"dt", "ts", "tinterval", "sampleinterval", "samplinginterval", "samplingperiod", "sampletime", "increment",
          "xincrement", "deltat", "timestep"}  # fmt: skip
_TIMES = {name.replace(" ", "").replace("-", "") for name in TIME_NAMES} | {"timevec", "timevector", "times", "tout"}
_DATES = {"start_utc_ns"}
_STARTS = {"t0", "tstart", "tzero", "start", "starttime", "timestart", "xzero", "xstart", "timeoffset"}
"""Time of the first sample of one array [s]."""
_SAME_RATE = 1e-3
_UNIX = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
"""Numbers from which on a start without a unit is a Unix time in ns, us, ms, and s per number."""
_MOST_CHANNELS = 64  # of a matrix: what has more columns is a picture or a table of results
_BOMB = 1000  # times a file may be larger unpacked
_SMALL = 1 << 26
_UNIT_BEHIND_SLASH = re.compile(r"[kmuµ]?V|[kmuµ]A")
"""A alone may be a phase, or an input of PicoScope."""
_CODES = "whole numbers"
"""Unit of what may be codes: it is unknown, so the channel is refused with what to type."""


@dataclass(frozen=True, slots=True)
class Signal:
    """One array of a file [samples], which is read when somebody asks."""

    name: str
    length: int
    read: Callable[[], Any]
    unit: str = ""
    step_s: float | None = None
    start_utc_ns: int | None = None
    scale: float = 1.0
    offset: float = 0.0
    unapplied: bool = False
    """The file has a factor whose meaning is not standard."""

    @property
    def is_time(self) -> bool:
        """Whether the name or the unit says so."""
        name, unit = _label(self.name)
        try:
            found = unit_of(self.unit or unit)
        except UnknownUnitError:
            found = None
        if found is not None:
            return found.quantity == "t"
        key = _key(name.rpartition("/")[2])
        return key in _TIMES or "time" in name.lower().replace("_", " ").replace("/", " ").split()

    @property
    def seconds(self) -> float:
        """Per number of an array of times."""
        try:
            found = unit_of(self.unit or _label(self.name)[1])
        except UnknownUnitError:
            found = None
        return found.factor if found is not None and found.quantity == "t" else 1.0


@dataclass(slots=True)
class Contents:
    """What a file holds."""

    signals: list[Signal] = field(default_factory=list)
    numbers: dict[str, float] = field(default_factory=dict)
    """Scalars by name."""
    names: dict[str, list[str]] = field(default_factory=dict)
    """Lists of texts by name: names of the columns of a matrix."""
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, shape: tuple[int, ...], read: Callable[[], Any], unit: str = "", **more: Any) -> None:
        """An array of real numbers: a channel, or a matrix of channels."""
        sizes = tuple(size for size in shape if size != 1)
        if len(sizes) == 1:
            self.signals.append(Signal(name, sizes[0], lambda: np.reshape(read(), -1), unit, **more))
        elif len(sizes) == 2 and min(sizes) <= _MOST_CHANNELS:
            across = int(np.argmin(sizes))
            listed = self._column_names(name, sizes[across])
            for k, one in enumerate(listed):
                self.signals.append(
                    Signal(one, sizes[1 - across], lambda k=k: _taken(read(), sizes, k, across), unit, **more)  # type: ignore[misc]
                )
        elif len(sizes) > 1:
            self.notes.append(f"{name} has the shape {shape}: no channels")

    def _column_names(self, name: str, count: int) -> list[str]:
        """Names of the columns of a matrix: those of a list of so many texts, else numbered."""
        lists = [texts for texts in self.names.values() if len(texts) == count]
        if len(lists) == 1:
            return lists[0]
        stem, unit = _label(name)
        return [f"{stem}{k + 1}" + (f" [{unit}]" if unit else "") for k in range(count)]


def _label(name: str) -> tuple[str, str]:
    """Name and unit of an array. What stands before a slash is a group or struct (`s/Va`), unless a unit follows."""
    folder, slash, last = name.rpartition("/")
    if not slash or " / " in name or _UNIT_BEHIND_SLASH.fullmatch(last):
        return split_label(name)
    stem, unit = split_label(last)
    return f"{folder}/{stem}", unit


def _taken(array: Any, sizes: tuple[int, int], k: int, across: int) -> Any:
    return np.take(np.reshape(array, sizes), k, axis=across)


def check_size(path: Path, announced: int) -> None:
    """Raises InputError for arrays that no file of this size holds, and for more than acqd meters in memory."""
    size = path.stat().st_size
    if announced > max(_BOMB * size, _SMALL) or announced > MOST_BYTES:
        raise InputError(
            path,
            f"announces {announced / 1e6:.0f} MB in a file of {size / 1e6:.3g} MB; is it damaged, or a sparse one?",
        )


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
        skews = _skews(path, [chosen[k] for k in used], times, contents.numbers)
        for k, skew_s in zip(used, skews, strict=True):
            shown[k] = replace(shown[k], skew_s=skew_s)
    recording = Recording(
        path, title, shown, length, lambda k: _column(path, chosen[k]), None,
        notes=notes, noun="array", advice=advice,
    )  # fmt: skip
    _set_clock(
        recording,
        [chosen[k] for k in used] or chosen,
        [one for one in times if one.length == length],
        contents.numbers,
        given,
    )
    recording.f_nominal = next((v for k, v in contents.numbers.items() if _key(k) in ("fnominal", "fnom")), None)
    recording.simulated = bool(contents.numbers.get("simulated"))
    if given.u_scale is None and given.i_scale is None:
        recording.channels = [
            replace(channel, unit=_CODES) if _are_codes(path, signal) else channel
            for channel, signal in zip(recording.channels, chosen, strict=True)
        ]
    return recording


def _are_codes(path: Path, signal: Signal) -> bool:
    """Integers without a unit, or with a factor that is not applied: V and A, or codes? Nobody says."""
    unknown = not signal.unit and not _label(signal.name)[1]
    return (unknown or signal.unapplied) and _is_integer(path, signal)


def _is_integer(path: Path, signal: Signal) -> bool:
    if signal.scale != 1.0 or not any(one.quantity for one in readings(signal.name)):
        return False
    return bool(_values(path, signal).dtype.kind in "iu")


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


def _skews(path: Path, chosen: list[Signal], times: list[Signal], numbers: dict[str, float]) -> list[float]:
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
        if _key(name) in _STARTS and _owner(label) and f"{signal.name}/".startswith(f"{_owner(label)}/"):
            since_1970 = next((factor for least, factor in _UNIX if abs(value) > least), 1.0)
            return _Begin(label, value * (_step_unit(unit) if unit else since_1970), "number")
    return None


def _owner(label: str) -> str:
    """Group, struct or array that a number or an array of times belongs to."""
    return label.rpartition("/")[0]


def _channel(signal: Signal) -> Channel:
    name, unit = _label(signal.name)
    return Channel(signal.name if signal.unit else name, signal.unit or unit)


def _values(path: Path, signal: Signal) -> Any:
    """The array of a signal. Raises InputError."""
    try:
        return np.asarray(signal.read())
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes its library raise
        raise InputError(path, f"{signal.name} cannot be read ({_short(error)})") from None


def _column(path: Path, signal: Signal) -> Column:
    values = _values(path, signal)
    if values.dtype.kind not in "iuf" or values.shape != (signal.length,):
        raise InputError(path, f"{signal.name} is {values.dtype} {values.shape}; expected {signal.length} numbers")
    if values.dtype.kind == "f" and values.dtype.itemsize > 8:
        values = values.astype(np.float64)
    return Column(values, signal.scale, signal.offset)


def _short(error: Exception) -> str:
    """The first line of what a library says."""
    text = (str(error).splitlines() or [""])[0]
    return text[:120] or type(error).__name__


def damaged(path: Path, kind: str, error: Exception) -> InputError:
    """One line for whatever a library raises on a damaged file."""
    return InputError(path, f"is truncated or no {kind} ({_short(error)})")


def _set_clock(
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
    if recording.start_utc_ns is None:
        recording.start_utc_ns = stamped if stamped is not None else clock.start_utc_ns
    if said and clock.rate and abs(said / clock.rate - 1) > _SAME_RATE:
        recording.notes.append(
            f"its numbers say {said:g} samples/s, its times {clock.rate:.6g}: the times count; --rate overrules both"
        )


def _seconds(path: Path, signal: Signal) -> tuple[Floats, float, int | None]:
    """An array of times [s], their resolution [s], and the UTC of the first one where the array holds dates."""
    values = _values(path, signal)
    if values.dtype.kind == "M":
        ns = values.astype("datetime64[ns]").astype(np.int64)
        if (ns == np.iinfo(np.int64).min).any():
            raise InputError(path, f"{signal.name} has times that are missing")
        return (ns - ns[0]) * 1e-9, 1e-9, int(ns[0])
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
        key = _key(name)
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


def _key(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())


def scalar(value: Any) -> float | None:
    """The one finite real number in an array; None for anything else."""
    listed = np.asarray(value).reshape(-1)
    if listed.size != 1 or listed.dtype.kind not in "iufb" or not np.isfinite(listed).all():
        return None
    return float(listed[0])
