"""Flicker of recordings (Pst, Plt), as JSON lines."""

from __future__ import annotations

import math
from pathlib import Path
from typing import BinaryIO

import orjson

from acqd.errors import UserError
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.flicker import FlickerMeter
from acqd.metering.quality.lamp import LampName
from acqd.metering.quality.severity import SHORT_S, LongTerm, Severity
from acqd.telemetry.row import CHANNELS
from acqd.timestamps import rfc3339


class FlickerWriter:
    """Writes Pst of every ten minutes and Plt of every two hours of one recording."""

    def __init__(self, form: StreamFormat, lamp: LampName, device: str, out: BinaryIO, *, on_the_clock: bool) -> None:
        """Without `on_the_clock` the intervals begin with the recording, and there is no Plt."""
        self._meter = FlickerMeter(form, lamp, on_the_clock=on_the_clock)
        self._long = LongTerm() if on_the_clock else None
        self._lamp, self._device, self._out = lamp, device, out

    def take(self, block: SampleBlock) -> None:
        """Write what `block` completes."""
        for short in self._meter.feed(block):
            self._write("Pst", short)
            if self._long is not None and (long := self._long.take(short)) is not None:
                self._write("Plt", long)

    def _write(self, name: str, severity: Severity) -> None:
        for channel, value in zip(CHANNELS, severity.value.tolist(), strict=False):
            line = {
                "device": self._device,
                "channel": channel,
                "time": rfc3339(severity.utc_ns),
                "duration": severity.duration,
                name: None if math.isnan(value) else value,
                "lamp": self._lamp,
                "flags": sorted(severity.flags),
            }
            self._out.write(orjson.dumps(line, option=orjson.OPT_APPEND_NEWLINE))


def check_length(path: Path, seconds: float) -> None:
    """Raises UserError for a recording that is too short for any Pst."""
    if seconds < SHORT_S:
        raise UserError(f"{path}: has {seconds:g} s; --flicker needs {SHORT_S} s or more")
