"""Synchrophasors of a recording, as JSON lines."""

from __future__ import annotations

import cmath
import math
from typing import BinaryIO

import orjson

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.synchrophasor import PhasorReport, SynchrophasorMeter
from acqd.telemetry.row import CHANNELS
from acqd.timestamps import filetime, rfc3339

_DEAD = 0.05
"""Share of the nominal voltage below which there is no frequency."""


class PhasorFile:
    """One line per report: instant, f, ROCOF, and the phasors of every phase."""

    def __init__(self, out: BinaryIO, form: StreamFormat, device: str, nominal_voltage: float) -> None:
        self._out, self._device = out, device
        self._meter = SynchrophasorMeter(form, _DEAD * nominal_voltage)

    def take(self, block: SampleBlock) -> None:
        """Write the reports that the block completes."""
        for report in self._meter.feed(block):
            self._out.write(orjson.dumps(self._line(report)) + b"\n")

    def _line(self, report: PhasorReport) -> dict[str, object]:
        line: dict[str, object] = {
            "device": self._device, "time": rfc3339(report.utc_ns), "filetime": filetime(report.utc_ns),
            "f": _known(report.f), "rocof": _known(report.rocof), "flags": sorted(report.flags),
        }  # fmt: skip
        for channel, U, I in zip(CHANNELS, report.U.tolist(), report.I.tolist(), strict=False):  # noqa: E741
            line[channel] = {"V": abs(U), "V_angle": _degrees(U), "I": abs(I), "I_angle": _degrees(I)}
        if len(report.U) == 3:
            line["positive"] = {"V": abs(report.positive), "V_angle": _degrees(report.positive)}
        return line


def _degrees(phasor: complex) -> float | None:
    return math.degrees(cmath.phase(phasor)) if phasor else None


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
