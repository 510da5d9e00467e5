"""Plays recordings through the same source, meter and rows as the daemon, in real time or as fast as possible."""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeAlias

from acqd.daemon.aggregate_file import AggregateFile
from acqd.daemon.events.of_recording import EventSettings, EventWriter, doubt_of_voltage
from acqd.daemon.flicker_writer import FlickerWriter, check_length
from acqd.daemon.half_cycle_file import HalfCycleFile
from acqd.daemon.output_file import output_file
from acqd.daemon.phasor_file import PhasorFile
from acqd.daemon.playback_report import PlaybackReport, describe
from acqd.daemon.publish import Publisher
from acqd.daemon.quality_feed import UNDEFINED, QualityFeed
from acqd.daemon.quality_section import QualitySection
from acqd.errors import UserError
from acqd.metering import Meter, Mode, SampleBlock, StreamFormat, WindowBatch
from acqd.metering.other_mains import meter_for, row_window
from acqd.metering.quality.lamp import LampName
from acqd.plc.executive import Executive
from acqd.sources import ChannelMap, ReplaySource, Waveform, load_waveform
from acqd.sources.recording.wired import wired
from acqd.sources.spec import replay_spec
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.quality_row import QualityRow, quality_lines
from acqd.telemetry.row import json_lines, rows_of

_Taker: TypeAlias = Callable[[SampleBlock], None]
_MINUTE_S, _OFF = 60.0, 0.006  # EN 50160: 50 Hz within 1 % for 99.5 % of a year, in practice within 0.4 %
_CHUNK_S = 10.0  # of waveform per step at full speed


@dataclass(frozen=True, slots=True)
class Playback:
    """Which files to play, how to meter them, and where to put the rows."""

    files: list[Path]
    channels: ChannelMap
    device: str
    mode: Mode
    window: float
    nominal_voltage: float
    loops: int
    real_time: bool
    start_utc_ns: int | None
    out: Path | None
    aggregate: Path | None
    quality: Path | None
    quality_section: QualitySection
    events: EventSettings | None
    flicker: Path | None
    phasors: Path | None
    half_cycles: Path | None
    lamp: LampName
    broker: BrokerAddress | None


def play(settings: Playback, progress: Callable[[float], None]) -> PlaybackReport:
    """Play all files in turn. Raises UserError; in that case no output file is left behind."""
    events = settings.events.out if settings.events else None
    named = (
        *(settings.out, settings.aggregate, settings.quality, events),
        *(settings.flicker, settings.phasors, settings.half_cycles),
    )
    outputs = [path.resolve() for path in named if path is not None and str(path) != "-"]
    for path in outputs:
        if (path.is_file() and path in [file.resolve() for file in settings.files]) or outputs.count(path) > 1:
            raise UserError(
                f"{path} would be overwritten; --out, --aggregate, --quality, --events, --flicker, "
                "--phasors and --half-cycles need separate files"
            )
    waveforms = [load_waveform(path, settings.channels) for path in settings.files]
    for path, waveform in zip(settings.files, waveforms, strict=True) if settings.flicker else ():
        check_length(path, waveform.duration * settings.loops)
    if settings.aggregate or settings.quality or settings.events or settings.flicker:
        odd = next((k for k, one in enumerate(waveforms) if not one.form.usual), None)
        if odd is not None:
            raise UserError(f"{settings.files[odd]}: mains of {waveforms[odd].form.f_nominal:g} Hz: {UNDEFINED}")
    report = PlaybackReport(recorded_s=sum(w.duration for w in waveforms) * settings.loops)
    report.notes = [
        f"{path}: {note}" for path, one in zip(settings.files, waveforms, strict=True) for note in one.notes
    ]
    run = _Run(settings, report, progress)
    begun = time.perf_counter()
    with ExitStack() as stack:
        run.rows_out = stack.enter_context(output_file(settings.out)) if settings.out else None
        run.values_out = stack.enter_context(output_file(settings.aggregate)) if settings.aggregate else None
        run.quality_out = stack.enter_context(output_file(settings.quality)) if settings.quality else None
        run.events_out = stack.enter_context(output_file(settings.events.out)) if settings.events else None
        run.flicker_out = stack.enter_context(output_file(settings.flicker)) if settings.flicker else None
        run.phasors_out = stack.enter_context(output_file(settings.phasors)) if settings.phasors else None
        run.half_cycles_out = stack.enter_context(output_file(settings.half_cycles)) if settings.half_cycles else None
        run.publisher = stack.enter_context(Publisher(settings.broker, settings.device)) if settings.broker else None
        for path, waveform in zip(settings.files, waveforms, strict=True):
            run.play(path, waveform)
    report.elapsed_s = time.perf_counter() - begun
    for path, waveform in zip(settings.files, waveforms, strict=True):
        report.notes += [f"{path}: wiring: {one.remedy}" for one in wired(waveform).findings]
        known = [line.f for line in report.channels if line.file == str(path) and line.f is not None]
        report.notes += _doubt_of_rate(path, waveform, known)
    return report


def _doubt_of_rate(path: Path, waveform: Waveform, f: list[float]) -> list[str]:
    """A hint where the mains of minutes are not those of any grid: then the sampling rate may be wrong."""
    nominal = waveform.form.f_nominal
    if not f or waveform.duration < _MINUTE_S or abs(f[0] / nominal - 1) < _OFF:
        return []
    return [
        f"{path}: its mains have {f[0]:.3f} Hz over {waveform.duration:.0f} s, and grids keep within "
        f"{100 * _OFF:.1f} % of {nominal:g} Hz: is the sampling rate right ({waveform.form.rate:g} samples/s)?"
    ]


class _Run:
    """A running playback: its outputs, and what it has counted so far."""

    def __init__(self, settings: Playback, report: PlaybackReport, progress: Callable[[float], None]) -> None:
        self._settings = settings
        self._report = report
        self._progress = progress
        self._boot = uuid.uuid4().hex[:12]
        self._seq = 0  # windows of the previous files
        self._played_s = 0.0
        self.rows_out: BinaryIO | None = None
        self.values_out: BinaryIO | None = None
        self.quality_out: BinaryIO | None = None
        self._quality = QualityFeed(
            settings.quality_section, settings.device, settings.nominal_voltage, lambda: self._boot
        )
        self.events_out: BinaryIO | None = None
        self._events: EventWriter | None = None
        self.flicker_out: BinaryIO | None = None
        self.phasors_out: BinaryIO | None = None
        self.half_cycles_out: BinaryIO | None = None
        self._on_the_clock = False  # whether the recording says when it was made
        self.publisher: Publisher | None = None

    def play(self, path: Path, waveform: Waveform) -> None:
        """Meter one file."""
        batches: list[WindowBatch] = []
        window = row_window(waveform.form, self._settings.window)
        self._on_the_clock = waveform.start_utc_ns is not None or self._settings.start_utc_ns is not None

        def take(batch: WindowBatch) -> None:
            batches.append(batch)
            self._deliver(batch)
            self._played_s += len(batch) * window
            self._progress(min(1.0, self._played_s / self._report.recorded_s))

        if self._settings.real_time:
            meter = asyncio.run(self._in_real_time(path, window, take))
        else:
            meter = self._at_full_speed(waveform, take)
        self._report.unused_samples += meter.finish()
        self._put_quality(self._quality.finish())
        if self._events is not None:
            self._report.events = self._events.finish()
        if batches:
            whole = WindowBatch.join(batches)
            self._report.channels += describe(str(path), whole)
            if self._settings.events is not None:
                self._report.notes += doubt_of_voltage(path, self._settings.events.section, whole)
            self._seq += int(whole.seq[-1]) + 1

    def _make_meter(self, form: StreamFormat) -> Meter:
        settings = self._settings
        return meter_for(form, window=settings.window, mode=settings.mode, nominal_voltage=settings.nominal_voltage)

    def _at_full_speed(self, waveform: Waveform, take: Callable[[WindowBatch], None]) -> Meter:
        source = ReplaySource(waveform, self._settings.loops)
        source.open(self._settings.start_utc_ns or time.time_ns())
        meter = self._make_meter(source.form)
        watch = self._make_watch(source.form)
        chunk = int(_CHUNK_S * source.form.rate)
        while (block := source.read(chunk)) is not None:
            batch = meter.feed(block)
            watch(block)
            if batch is not None:
                take(batch)
        return meter

    async def _in_real_time(self, path: Path, window: float, take: Callable[[WindowBatch], None]) -> Meter:
        settings = self._settings
        spec = replay_spec(path, settings.channels, settings.loops) | {"start_utc_ns": settings.start_utc_ns}
        executive = Executive(spec, self._make_meter, take, window=window, make_watch=self._make_watch)
        await executive.start()
        await executive.run()
        executive.close()
        assert executive.meter is not None
        return executive.meter

    def _deliver(self, batch: WindowBatch) -> None:
        shifted = batch.renumbered(self._seq)
        rows = list(rows_of(shifted, self._settings.device, self._boot))
        self._report.rows += len(rows)
        if self.rows_out is not None:
            self.rows_out.write(json_lines(rows))
        if self.publisher is not None:
            self.publisher.publish(rows)

    def _make_watch(self, form: StreamFormat) -> _Taker:
        """What else the samples of a file of this format go to."""
        settings = self._settings
        takers: list[_Taker] = []
        if self.values_out is not None:
            takers.append(AggregateFile(self.values_out, form, settings.device, settings.nominal_voltage).take)
        if self.quality_out is not None:
            self._quality.open(form)
            takers.append(self._take_quality)
        if self.events_out is not None and settings.events is not None:
            first = self._report.events
            self._events = EventWriter(settings.events, form, settings.device, self._boot, self.events_out, first)
            takers.append(self._events.take)
        if self.flicker_out is not None:
            clock = self._on_the_clock
            takers.append(
                FlickerWriter(form, settings.lamp, settings.device, self.flicker_out, on_the_clock=clock).take
            )

        if self.phasors_out is not None:
            takers.append(PhasorFile(self.phasors_out, form, settings.device, settings.nominal_voltage).take)
        if self.half_cycles_out is not None:
            takers.append(HalfCycleFile(self.half_cycles_out, form, settings.device).take)

        def watch(block: SampleBlock) -> None:
            for take in takers:
                take(block)

        return watch

    def _take_quality(self, block: SampleBlock) -> None:
        self._put_quality(self._quality.take(block))

    def _put_quality(self, rows: list[QualityRow]) -> None:
        if self.quality_out is not None:
            self.quality_out.write(quality_lines(rows))
