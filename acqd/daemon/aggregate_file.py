"""`acqd replay --aggregate`: 10/12-cycle values without a spectrum, as JSON lines."""

from __future__ import annotations

from typing import BinaryIO

import orjson

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.quality.event_flags import INTERRUPTION
from acqd.metering.quality.intervals import Interval, IntervalCutter, threshold
from acqd.metering.quality.quantities import waveform_values
from acqd.telemetry.row import CHANNELS
from acqd.timestamps import rfc3339


class AggregateFile:
    """Writes what `take` completes."""

    def __init__(self, file: BinaryIO, form: StreamFormat, device: str, nominal_voltage: float) -> None:
        self._file, self._device = file, device
        self._cutter = IntervalCutter(form, threshold(form, INTERRUPTION, nominal_voltage))

    def take(self, block: SampleBlock) -> None:
        """Write the intervals that the block completes."""
        for interval in self._cutter.feed(block):
            if not interval.trailing:
                self._write(interval)

    def _write(self, interval: Interval) -> None:
        values = waveform_values(interval)
        for phase in range(len(values["P"])):
            line = {
                "device": self._device,
                "channel": CHANNELS[phase],
                "time": rfc3339(interval.utc_ns),
                "cycles": interval.cycles,
                "duration": interval.duration,
                **{name: float(values[name][phase]) for name in ("Vrms", "Irms", "P")},
                "f": interval.f if interval.fit.credible else None,
                "flags": sorted(interval.flags),
            }
            self._file.write(orjson.dumps(line, option=orjson.OPT_APPEND_NEWLINE))
