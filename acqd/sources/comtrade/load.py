"""COMTRADE recordings as waveforms."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.metering.block import Codes
from acqd.metering.delay import delayed
from acqd.sources.comtrade.files import parts
from acqd.sources.comtrade.header import SIMULATED, AnalogChannel, Header, read_header
from acqd.sources.comtrade.samples import Samples
from acqd.sources.waveform import QUANTITIES, ChannelMap, Waveform, check_values, positions, stream_format

_UNITS = {
    **{
        name: ("u", factor)
        for factor, names in ((1.0, "v volt volts"), (1e3, "kv"), (1e-3, "mv"))
        for name in names.split()
    },
    **{
        name: ("i", factor)
        for factor, names in ((1.0, "a amp amps ampere amperes"), (1e3, "ka"), (1e-3, "ma"))
        for name in names.split()
    },
}
_PHASES = {"a": "1", "l1": "1", "r": "1", "1": "1", "b": "2", "l2": "2", "s": "2", "2": "2", "c": "3", "l3": "3"}
_PHASES |= {"t": "3", "3": "3"}
_SHOWN = 6  # channels that are not metered
_STEP_SLACK = 0.05  # of a period: how far times may be from an even step


def load(path: Path, channels: ChannelMap) -> Waveform:
    """CFG + DAT (give either) or CFF. Channels by unit and phase, or by --map with their names.

    Time stamps are local time; editions since 2013 say how far that is from UTC, others are taken as UTC. Secondary
    quantities are converted to primary ones. Channels that are sampled later than others (skew) are interpolated to
    common times. Raises InputError.
    """
    try:
        text, content = parts(path, channels.encoding)
    except PermissionError:
        raise
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    header = read_header(path, text)
    names = [channel.name for channel in header.channels]
    pairs = channels.pairs(path, _by_unit(header.channels))
    columns = positions(path, names, pairs, "analog channel")
    _check_units(path, [header.channels[column] for column in columns], channels)
    samples = Samples(path, header, content)
    rate = channels.rate or _rate(path, header, samples)
    record = _Record(path, header, samples, columns, rate)
    codes, scale, utc_ns = record.codes(channels)
    form = stream_format(path, rate, scale, channels.f_nominal or _nominal(header.frequency), codes)
    notes = () if channels.columns else _left_out(header.channels, columns)
    return Waveform(path.name, codes, form, utc_ns, header.device == SIMULATED, (*notes, *samples.notes))


@dataclass(frozen=True, slots=True)
class _Record:
    """The channels that are metered."""

    path: Path
    header: Header
    samples: Samples
    columns: list[int]
    rate: float

    def codes(self, given: ChannelMap) -> tuple[Codes, list[float], int | None]:
        """Codes [samples, channels], V or A per code, and UTC [ns] of the first."""
        chosen = [self.header.channels[k] for k in self.columns]
        factors = [(given.i_scale if k % 2 else given.u_scale) or _factor(c) for k, c in enumerate(chosen)]
        skews = [(channel.skew_us - chosen[0].skew_us) * 1e-6 * self.rate for channel in chosen]
        start = self.header.start_utc_ns
        if start is not None:
            start += round(chosen[0].skew_us * 1000)
        if self.header.file_type == "BINARY" and not any(skews) and all(_is_code(c) for c in chosen):
            integers = np.empty((len(self.samples), len(chosen)), np.int16)
            for k, column in enumerate(self.columns):
                integers[:, k] = self.samples.column(column)
            return integers, [c.a * factor for c, factor in zip(chosen, factors, strict=True)], start
        first, last = self._common(skews)
        values = np.empty((last - first, len(chosen)))
        for k, (column, skew) in enumerate(zip(self.columns, skews, strict=True)):
            values[:, k] = delayed(self._values(column), skew, first, last)
        check_values(self.path, values)
        return values, factors, None if start is None else start + round(first * 1e9 / self.rate)

    def _values(self, column: int) -> Floats:
        channel = self.header.channels[column]
        return np.asarray(self.samples.column(column).astype(np.float64) * channel.a + channel.b)

    def _common(self, skews: list[float]) -> tuple[int, int]:
        """Samples at whose time every channel is known."""
        count = len(self.samples)
        first, last = math.ceil(max(0.0, *skews)), count + math.floor(min(0.0, *skews))
        if first >= last:
            raise InputError(self.path, "the skews of its channels are longer than the recording")
        return first, last


def _check_units(path: Path, chosen: list[AnalogChannel], given: ChannelMap) -> None:
    """Raises InputError for a current in V, and for a unit that says nothing, unless the user gives the scale."""
    for key, channel in zip(QUANTITIES, chosen, strict=False):
        unit, wanted = channel.unit.strip().lower(), "V" if key[0] == "u" else "A"
        if (
            unit
            and _UNITS.get(unit, ("", 0.0))[0] != key[0]
            and not (given.u_scale if key[0] == "u" else given.i_scale)
        ):
            raise InputError(
                path,
                f"channel {channel.name!r} for {key} is in {channel.unit}; expected {wanted} (see --map), or say how "
                f"many {wanted} its unit is with --{key[0]}-scale",
            )


def _left_out(channels: list[AnalogChannel], columns: list[int]) -> tuple[str, ...]:
    """Says which of several voltages or currents of a phase are metered."""
    units = [_UNITS.get(channel.unit.lower(), ("", 0.0))[0] for channel in channels]
    others = [channel.name for k, channel in enumerate(channels) if units[k] and k not in columns]
    if not others:
        return ()
    metered = ", ".join(f"{key}={channels[column].name}" for key, column in zip(QUANTITIES, columns, strict=False))
    more = f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
    return (f"metered are {metered}; it also has {', '.join(others[:_SHOWN])}{more} (--map selects)",)


def _is_code(channel: AnalogChannel) -> bool:
    """Whether the stored numbers are codes of a converter with a plausible scale."""
    return 1e-7 < channel.a < 1e3 and channel.b == 0 and channel.maximum <= 2**15 - 1


def _factor(channel: AnalogChannel) -> float:
    """V or A (primary) per unit of the file."""
    unit = _UNITS.get(channel.unit.lower(), ("", 1.0))[1]
    return unit * (channel.ratio if channel.secondary else 1.0)


def _rate(path: Path, header: Header, samples: Samples) -> float:
    """The one sampling rate [1/s]."""
    rates = {segment.rate for segment in header.segments}
    if len(rates) > 1:
        steps = ", ".join(f"{segment.rate:g} Hz" for segment in header.segments)
        raise InputError(path, f"changes its sampling rate ({steps}); one constant rate is needed")
    rate = rates.pop()
    if rate and len(header.segments) == 1:
        return rate
    times = samples.times()
    if times is None or len(times) < 2 or times[-1] <= 0:
        if rate:
            return rate
        raise InputError(path, "says neither its sampling rate nor the samples' times; give --rate")
    step = 1 / rate if rate else float(times[-1]) / (len(times) - 1)
    slack = _STEP_SLACK * step + 2 * header.tick_s
    uneven = np.flatnonzero(np.abs(np.diff(times) - step) > slack)
    if len(uneven):
        at = int(uneven[0])
        raise InputError(
            path,
            f"sample {at + 2} comes {(times[at + 1] - times[at]) * 1e6:g} us after the one before, expected "
            f"{step * 1e6:g} us; give --rate to take the samples as equidistant",
        )
    return 1 / step


def _by_unit(channels: list[AnalogChannel]) -> dict[str, str]:
    """u1, i1 ... by unit, and by the phase the file declares or the name ends in."""
    found: dict[str, str] = {}
    for channel in channels:
        kind = _UNITS.get(channel.unit.lower())
        if kind is None:
            continue
        ending = re.search(r"(l?[123]|[abcrst])$", channel.name.lower())
        phase = _PHASES.get(channel.phase.lower()) or (_PHASES.get(ending.group(1)) if ending else None)
        if phase:
            found.setdefault(f"{kind[0]}{phase}", channel.name)
    return found


def _nominal(f: float) -> float:
    return f if 45 <= f <= 65 else 50.0
