"""Flicker of a running stream: Pst of every ten minutes and Plt of every two hours, as values of power quality."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import ceil

import numpy as np

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.gathered import Gathered
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
    """Filters a second of samples at a time."""

    def __init__(self, form: StreamFormat, declared_voltage: float) -> None:
        self._form = form
        self._meter, self._long = FlickerMeter(form, lamp_of(declared_voltage)), LongTerm()
        self._gathered = Gathered(ceil(form.rate))

    def feed(self, block: SampleBlock) -> Iterator[QualityValues]:
        """Values that `block` completes."""
        return self._filter(self._gathered.add(block))

    def rest(self) -> Iterator[QualityValues]:
        """Values that the samples since the last second complete: no more will come."""
        return self._filter(self._gathered.rest())

    def _filter(self, blocks: Iterable[SampleBlock]) -> Iterator[QualityValues]:
        for second in blocks:
            for short in self._meter.feed(second):
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
