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

_IN_TURN, _AT_RANDOM = 0.99, 0.5
"""Shares of rows whose numbers rise by one: above the first, the others are misplaced; shares of rows whose numbers
rise alike (by 0 or 4 as well): below the second, with uneven times as well, the rows are cut at the wrong places."""
_BACK = 1_000
"""Rows: numbers that fall by more, or to 0 or 1, have begun again."""
_NOTED = 2e-4
"""How far the times may be from the header's rate without a word: 10 mHz of the mains."""
_STEP_SLACK = 0.05  # of a period: how far times may be from an even step
_RATE_SLACK = 1e-3  # how far the mean step may be from the header's rate: 0.05 Hz of the mains
_DECADE_SLACK = 0.03  # of a power of ten: 7 %
_FOLLOWS = 0.02
"""Between the rates of segments: frequencies of the mains are within 1 % of the nominal one (EN 50160)."""
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
    _refuse_disorder(path, header, samples)
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


def _refuse_disorder(path: Path, header: Header, samples: Samples) -> None:
    """Raises InputError for rows that are doubled, exchanged or cut at the wrong places: their numbers say so."""
    numbers = samples.numbers()
    rises = np.diff(numbers)
    if not len(rises):
        return
    if _IN_TURN < (rises == 1).mean() < 1:
        doubled = (rises == 0) & (numbers[1:] < numbers.max())  # a counter may stay at its largest number
        wrong = doubled | ((rises < 0) & (rises > -_BACK) & (numbers[1:] > 1))
        times = samples.times()
        wrong &= times is None or np.diff(times) <= 0
        if wrong.any():
            at = int(np.argmax(wrong))
            raise InputError(
                path,
                f"row {at + 2} has number {numbers[at + 1]} after {numbers[at]}: doubled or out of order; export again",
            )
    alike = float((rises == np.median(rises)).mean())
    if alike < _AT_RANDOM and header.file_type != "ASCII" and not _even(samples.times()):
        raise InputError(
            path,
            f"its rows are not numbered 1, 2, 3 ...: the {header.file_type} data do not fit the header "
            f"({len(header.channels)} analog, {header.digital} status channels); check counts, file type, byte order",
        )


def _even(times: Floats | None) -> bool:
    steps = np.diff(times) if times is not None else np.empty(0)
    return bool(
        len(steps) and np.median(steps) > 0 and (np.abs(steps / np.median(steps) - 1) < 0.5).mean() > _AT_RANDOM
    )


def _channel(channel: AnalogChannel) -> Channel:
    ratio = channel.ratio if channel.secondary else 1.0
    return Channel(channel.name, channel.unit, channel.phase, channel.circuit, ratio, channel.skew_us * 1e-6)


def _other_rate(steps: Floats, step: float, tick_s: float, slack: float = _RATE_SLACK) -> float | None:
    """Samples/s that the times say, where that is another rate than the header's; None where both agree.

    Recorders round every time to a tick, or the step, whose mean is half a tick off then.
    """
    usual = float(np.median(steps))
    even = steps[np.abs(steps - usual) <= _STEP_SLACK * usual + 2 * tick_s]  # without the pauses
    if not len(even):
        return None  # times that mean nothing
    mean = float(even.mean())
    rounded = 0.51 * tick_s if np.ptp(even) < 0.5 * tick_s else 2 * tick_s / len(even)
    agree = abs(mean - step) <= slack * step + rounded
    return None if agree or mean <= 0 else 1 / mean


def _nearly(rate: float, other: float | None) -> list[str]:
    said = f"its header says {rate:g} samples/s, the times of its samples {other or rate:.7g}"
    return [f"{said}: f and W follow the header (--rate)"] if rate and other else []


def _one_rate(path: Path, header: Header, notes: list[str]) -> float:
    """The rate of all segments; the mean of rates that follow the frequency of the mains. Raises InputError."""
    rates = [segment.rate for segment in header.segments]
    least, most = min(rates), max(rates)
    if least == most:
        return least
    distinct = list(dict.fromkeys(rates))
    listed = ", ".join(f"{rate:g} Hz" for rate in distinct[:4]) + " ..." * (len(distinct) > 4)
    if most > (1 + _FOLLOWS) * least:
        raise InputError(
            path, f"changes its sampling rate ({listed}); one constant rate is needed: export the part of one rate"
        )
    begins = [0, *(segment.end for segment in header.segments)]
    lengths = np.diff(begins)
    lasts_s = float((lengths / np.array(rates)).sum())
    mean = begins[-1] / lasts_s if lasts_s > 0 and (lengths > 0).all() else float(np.mean(rates))
    notes.append(
        f"its sampling rate follows the mains ({least:g} to {most:g} Hz): metered at its mean of {mean:g} Hz, so f is "
        "that of the mean, and times are off by what the rates differ"
    )
    return mean


def _clock(
    path: Path, header: Header, samples: Samples, given: ChannelMap, notes: list[str]
) -> tuple[float | None, list[tuple[int, int]]]:
    """The one sampling rate [1/s], and where samples are missing."""
    rate = _one_rate(path, header, notes)
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
    notes += _nearly(rate, _other_rate(steps, step, header.tick_s, _NOTED) if len(header.segments) == 1 else None)
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
