"""COMTRADE recordings: header and data as channels and a clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.comtrade.files import parts
from acqd.sources.comtrade.header import SIMULATED, AnalogChannel, Header, read_header
from acqd.sources.comtrade.samples import Samples
from acqd.sources.recording.channel import Channel, Column, Recording
from acqd.sources.waveform import ChannelMap

_STEP_SLACK = 0.05  # of a period: how far times may be from an even step
_RATE_SLACK = 1e-3  # how far the mean step may be from the header's rate: 0.05 Hz of the mains
_DECADE_SLACK = 0.03  # of a power of ten: 7 %
_LONGEST_PAUSE_S = 86_400.0
_MOST_PAUSES = 0.001  # share of the samples: more jumps are no pauses, but times that mean nothing


def load(path: Path, given: ChannelMap) -> Recording:
    """CFG + DAT (give either) or CFF.

    Time stamps are local time; editions since 2013 say how far that is from UTC, others are taken as UTC. Secondary
    quantities are converted to primary ones. Segments of one rate with pauses between them are one recording with
    gaps. Raises InputError.
    """
    try:
        text, content = parts(path, given.encoding)
    except PermissionError:
        raise
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    header = read_header(path, text)
    samples = Samples(path, header, content)
    notes = [*header.notes, *samples.notes]
    rate, breaks = _clock(path, header, samples, given, notes)

    def column(number: int) -> Column:
        channel, stored = header.channels[number], samples.column(number)
        if header.file_type == "BINARY" and stored.dtype == np.int16:
            return Column(stored, channel.a, channel.b)
        return Column(stored.astype(np.float64), channel.a, channel.b)

    channels = [_channel(channel) for channel in header.channels]
    edition = f"COMTRADE {header.edition}, {header.file_type}"
    return Recording(
        path, edition, channels, len(samples), column, rate, header.start_utc_ns, header.frequency or None,
        header.device == SIMULATED, notes, breaks, "analog channel",
    )  # fmt: skip


def _channel(channel: AnalogChannel) -> Channel:
    ratio = channel.ratio if channel.secondary else 1.0
    return Channel(channel.name, channel.unit, channel.phase, channel.circuit, ratio, channel.skew_us * 1e-6)


def _other_rate(steps: Floats, step: float, tick_s: float) -> float | None:
    """Samples/s that the times say, where that is another rate than the header's; None where both agree.

    Recorders round every time to a tick, or the step, whose mean is half a tick off then.
    """
    usual = float(np.median(steps))
    even = steps[np.abs(steps - usual) <= _STEP_SLACK * usual + 2 * tick_s]  # without the pauses
    if not len(even):
        return None  # times that mean nothing
    mean = float(even.mean())
    rounded = 0.51 * tick_s if np.ptp(even) < 0.5 * tick_s else 2 * tick_s / len(even)
    agree = abs(mean - step) <= _RATE_SLACK * step + rounded
    return None if agree or mean <= 0 else 1 / mean


def _clock(
    path: Path, header: Header, samples: Samples, given: ChannelMap, notes: list[str]
) -> tuple[float | None, list[tuple[int, int]]]:
    """The one sampling rate [1/s], and where samples are missing."""
    rates = {segment.rate for segment in header.segments}
    if len(rates) > 1:
        listed = ", ".join(f"{segment.rate:g} Hz" for segment in header.segments)
        raise InputError(
            path, f"changes its sampling rate ({listed}); one constant rate is needed: export the part of one rate"
        )
    rate = rates.pop()
    times = samples.times()
    if times is None or len(times) < 2 or times[-1] <= 0:
        return rate or None, []
    steps = np.diff(times)
    step = 1 / rate if rate else float(np.median(steps))
    if step <= 0:
        raise InputError(path, "has times that do not rise; give --rate")
    slack = _STEP_SLACK * step + 2 * header.tick_s
    if rate and len(header.segments) == 1 and (other := _other_rate(steps, step, header.tick_s)):
        # Times in another unit differ by a power of ten, and the header's rate holds; else nobody knows which is right.
        decades = np.log10(other / rate)
        if given.rate is None and (round(decades) == 0 or abs(decades - round(decades)) > _DECADE_SLACK):
            raise InputError(
                path,
                f"its header says {rate:g} samples/s, the times of its samples {other:g}; "
                "say which is right with --rate",
            )
        return rate, []
    uneven = np.flatnonzero(np.abs(steps - step) > slack).tolist()
    pauses = [at for at in uneven if rate and step < steps[at] < _LONGEST_PAUSE_S]
    if pauses and len(pauses) > max(len(header.segments), _MOST_PAUSES * len(times)):
        return rate, []  # times that are not those of the samples
    if not rate and uneven and given.rate is None:
        at = uneven[0]
        raise InputError(
            path,
            f"sample {at + 2} comes {steps[at] * 1e6:g} us after the one before, expected {step * 1e6:g} us; "
            "give --rate to take the samples as equidistant",
        )
    if not rate:
        return 1 / (float(times[-1]) / (len(times) - 1)), []
    if pauses:
        text = ", ".join(f"{steps[at]:.3g} s before sample {at + 2}" for at in pauses[:3])
        notes.append(f"has pauses ({text}): gaps in the rows")
    return rate, [(at + 1, max(1, round(float(steps[at]) / step) - 1)) for at in pauses]
