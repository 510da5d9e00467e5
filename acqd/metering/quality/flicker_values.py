"""Flicker of a running stream: Pst of every ten minutes and Plt of every two hours, as values of power quality."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.flicker import FlickerMeter
from acqd.metering.quality.lamp import LampName
from acqd.metering.quality.severity import LongTerm, Severity
from acqd.metering.quality.values import Kind, QualityValues

_BETWEEN_V = 170.0
"""Declared voltages below are those of the 120 V lamp."""


def lamp_of(declared_voltage: float) -> LampName:
    """The lamp of the standard for this voltage [V]."""
    return "120V" if declared_voltage < _BETWEEN_V else "230V"


class FlickerValues:
    """Collects a second of samples before it filters them: short blocks cost more than their samples."""

    def __init__(self, form: StreamFormat, declared_voltage: float) -> None:
        self._form = form
        self._meter, self._long = FlickerMeter(form, lamp_of(declared_voltage)), LongTerm()
        self._waiting: list[SampleBlock] = []
        self._count = 0

    def feed(self, block: SampleBlock) -> Iterator[QualityValues]:
        """Values that `block` completes."""
        if self._waiting and ("clock_step" in block.flags or block.index != self._waiting[0].index + self._count):
            yield from self._filter()
        self._waiting.append(block)
        self._count += len(block.codes)
        if self._count >= self._form.rate:
            yield from self._filter()

    def _filter(self) -> Iterator[QualityValues]:
        blocks, self._waiting, self._count = self._waiting, [], 0
        flags = frozenset().union(*(block.flags for block in blocks))
        joined = replace(blocks[0], codes=np.concatenate([block.codes for block in blocks]), flags=flags)
        for short in self._meter.feed(joined):
            yield self._values("Pst", short)
            if (long := self._long.take(short)) is not None:
                yield self._values("Plt", long)

    def _values(self, kind: Kind, severity: Severity) -> QualityValues:
        return QualityValues(
            kind=kind,
            utc_ns=severity.utc_ns,
            duration=severity.duration,
            intervals=0,
            f=np.nan,
            rocof=np.nan,
            phase={kind: severity.value},
            system={},
            flags=severity.flags,
            phase_flags=[frozenset()] * self._form.phases,
        )
