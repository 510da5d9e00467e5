"""Playing recordings: the same source, meter and rows as the daemon's, at any speed."""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
import orjson

from acqd.daemon.publish import Publisher
from acqd.errors import UserError
from acqd.metering import Meter, Mode, SampleBlock, StreamFormat, WindowBatch
from acqd.metering.aggregate import TenTwelveCycle
from acqd.plc.executive import Executive
from acqd.sources import ChannelMap, ReplaySource, Waveform, load_waveform
from acqd.sources.spec import replay_spec
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.row import CHANNELS, rows_of
from acqd.timestamps import rfc3339

_CHUNK_S = 10.0  # of waveform per step at full speed


@dataclass(frozen=True, slots=True)
class Playback:
    """What to play, and where to put the rows."""

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
    broker: BrokerAddress | None


@dataclass(slots=True)
class ChannelReport:
    """One channel of one file: means over its windows."""

    file: str
    channel: str
    windows: int = 0
    Vrms: float | None = None
    Irms: float | None = None
    P: float | None = None
    f: float | None = None
    W: float = 0.0
    flagged: dict[str, int] = field(default_factory=dict)


@dataclass(slots=True)
class PlaybackReport:
    """The whole run."""

    rows: int = 0
    recorded_s: float = 0.0
    elapsed_s: float = 0.0
    unused_samples: int = 0
    channels: list[ChannelReport] = field(default_factory=list)


def play(orders: Playback, progress: Callable[[float], None]) -> PlaybackReport:
    """Play all files one after the other. Raises UserError; then no output file is left behind."""
    outputs = [path.resolve() for path in (orders.out, orders.aggregate) if path is not None and str(path) != "-"]
    for path in outputs:
        if (path.is_file() and path in [file.resolve() for file in orders.files]) or outputs.count(path) > 1:
            raise UserError(f"{path} would be written over; --out and --aggregate need files of their own")
    waveforms = [load_waveform(path, orders.channels) for path in orders.files]
    report = PlaybackReport(recorded_s=sum(w.duration for w in waveforms) * orders.loops)
    run = _Run(orders, report, progress)
    begun = time.perf_counter()
    with ExitStack() as stack:
        run.rows_out = stack.enter_context(_output(orders.out)) if orders.out else None
        run.values_out = stack.enter_context(_output(orders.aggregate)) if orders.aggregate else None
        run.publisher = stack.enter_context(Publisher(orders.broker, orders.device)) if orders.broker else None
        for path, waveform in zip(orders.files, waveforms, strict=True):
            run.play(path, waveform)
    report.elapsed_s = time.perf_counter() - begun
    return report


class _Run:
    """One playback under way."""

    def __init__(self, orders: Playback, report: PlaybackReport, progress: Callable[[float], None]) -> None:
        self._orders = orders
        self._report = report
        self._progress = progress
        self._boot = uuid.uuid4().hex[:12]
        self._seq = 0  # windows of the files before
        self._played_s = 0.0
        self.rows_out: BinaryIO | None = None
        self.values_out: BinaryIO | None = None
        self.publisher: Publisher | None = None

    def play(self, path: Path, waveform: Waveform) -> None:
        """Meter one file."""
        batches: list[WindowBatch] = []

        def take(batch: WindowBatch) -> None:
            batches.append(batch)
            self._deliver(batch)
            self._played_s += len(batch) * self._orders.window
            self._progress(min(1.0, self._played_s / self._report.recorded_s))

        if self._orders.real_time:
            meter = asyncio.run(self._in_real_time(path, take))
        else:
            meter = self._at_full_speed(waveform, take)
        self._report.unused_samples += meter.finish()
        if batches:
            whole = WindowBatch.join(batches)
            self._report.channels += _describe(str(path), whole)
            self._seq += int(whole.seq[-1]) + 1

    def _make_meter(self, form: StreamFormat) -> Meter:
        orders = self._orders
        return Meter(form, window=orders.window, mode=orders.mode, nominal_voltage=orders.nominal_voltage)

    def _at_full_speed(self, waveform: Waveform, take: Callable[[WindowBatch], None]) -> Meter:
        source = ReplaySource(waveform, self._orders.loops)
        source.open(self._orders.start_utc_ns or time.time_ns())
        meter = self._make_meter(source.form)
        aggregator = TenTwelveCycle(source.form) if self.values_out else None
        chunk = int(_CHUNK_S * source.form.rate)
        while (block := source.read(chunk)) is not None:
            batch = meter.feed(block)
            if aggregator is not None:
                self._write_values(aggregator, block, batch)
            if batch is not None:
                take(batch)
        return meter

    async def _in_real_time(self, path: Path, take: Callable[[WindowBatch], None]) -> Meter:
        orders = self._orders
        if self.values_out:
            raise UserError("--aggregate works with --speed max only")
        spec = replay_spec(path, orders.channels, orders.loops) | {"start_utc_ns": orders.start_utc_ns}
        executive = Executive(spec, self._make_meter, take, window=orders.window)
        await executive.start()
        await executive.run()
        executive.close()
        assert executive.meter is not None
        return executive.meter

    def _deliver(self, batch: WindowBatch) -> None:
        shifted = batch.renumbered(self._seq)
        rows = list(rows_of(shifted, self._orders.device, self._boot))
        self._report.rows += len(rows)
        if self.rows_out is not None:
            self.rows_out.write(b"".join([orjson.dumps(row, option=orjson.OPT_APPEND_NEWLINE) for row in rows]))
        if self.publisher is not None:
            self.publisher.publish(rows)

    def _write_values(self, aggregator: TenTwelveCycle, block: SampleBlock, batch: WindowBatch | None) -> None:
        assert self.values_out is not None
        for value in aggregator.feed(block, batch):
            for phase in range(len(value.P)):
                line = {
                    "device": self._orders.device,
                    "channel": CHANNELS[phase],
                    "time": rfc3339(value.utc_ns),
                    "cycles": value.cycles,
                    "duration": value.duration,
                    "Vrms": float(value.Vrms[phase]),
                    "Irms": float(value.Irms[phase]),
                    "P": float(value.P[phase]),
                    "f": value.f,
                    "flags": sorted(value.flags),
                }
                self.values_out.write(orjson.dumps(line, option=orjson.OPT_APPEND_NEWLINE))


@contextmanager
def _output(path: Path) -> Iterator[BinaryIO]:
    """A file that appears under its name only when everything has been written."""
    if str(path) == "-":
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()
        return
    path = path.resolve()  # a link stays a link
    if path.exists() and not path.is_file():  # a pipe or device is written, never replaced
        try:
            with path.open("wb") as stream:
                yield stream
        except OSError as error:
            raise UserError(f"{path}: cannot be written ({error.strerror}); choose another --out") from None
        return
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror}); choose another --out") from None
    try:
        with os.fdopen(handle, "wb", buffering=1 << 20) as file:
            yield file
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise UserError(f"{path}: cannot be written ({error.strerror}); nothing was left behind") from None
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _describe(file: str, batch: WindowBatch) -> list[ChannelReport]:
    reports = []
    for phase in range(len(batch.P)):
        counts = Counter(flag for named in batch.flags[phase] for flag in named)
        reports.append(
            ChannelReport(
                file,
                CHANNELS[phase],
                len(batch),
                _mean(batch.Vrms[phase]),
                _mean(batch.Irms[phase]),
                _mean(batch.P[phase]),
                _mean(batch.f),
                float(batch.W[phase, -1]),
                dict(counts),
            )
        )
    return reports


def _mean(values: np.ndarray) -> float | None:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else None
