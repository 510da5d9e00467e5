"""Urms(1/2) of a recording, as JSON lines."""

from __future__ import annotations

from typing import BinaryIO

import orjson

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.quality.half_cycle import HalfCycleStream
from acqd.telemetry.row import CHANNELS
from acqd.timestamps import filetime, rfc3339


class HalfCycleFile:
    """One line per half cycle and phase: the cycle that its value is of, and the value."""

    def __init__(self, out: BinaryIO, form: StreamFormat, device: str) -> None:
        self._out, self._form, self._device = out, form, device
        self._stream = HalfCycleStream(form)

    def take(self, block: SampleBlock) -> None:
        """Write the values that the block completes, phase by phase."""
        for values in self._stream.feed(block):
            for channel, begins, ends, Urms in zip(CHANNELS, values.begin, values.end, values.Urms, strict=False):
                for begin, end, U in zip(begins.tolist(), ends.tolist(), Urms.tolist(), strict=True):
                    utc_ns = block.utc_ns + round((begin - block.index) * 1e9 / self._form.rate)
                    line = {
                        "device": self._device, "channel": channel, "time": rfc3339(utc_ns),
                        "filetime": filetime(utc_ns), "duration": (end - begin) / self._form.rate, "Urms": U,
                    }  # fmt: skip
                    self._out.write(orjson.dumps(line) + b"\n")
