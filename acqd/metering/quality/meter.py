"""The power-quality meter: blocks of a stream in, values of all aggregation intervals out."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.aggregation import Aggregate
from acqd.metering.quality.event_flags import INTERRUPTION
from acqd.metering.quality.intervals import FIFTEEN, Interval, IntervalCutter, threshold
from acqd.metering.quality.quantities import DEFAULT, Options, measure
from acqd.metering.quality.telegram import TelegramRecorder
from acqd.metering.quality.ten_seconds import TenSeconds
from acqd.metering.quality.tick_values import TickValues
from acqd.metering.quality.values import QualityValues


class QualityMeter:
    """Meters one stream; is fed the same blocks as `Meter`, and independent of it."""

    def __init__(self, form: StreamFormat, *, declared_voltage: float = 230.0, options: Options = DEFAULT) -> None:
        """`declared_voltage` [V]: for the flags of dips, swells and interruptions."""
        self.form = form
        self._declared, self._options = declared_voltage, options
        self._cutter = IntervalCutter(form, threshold(form, INTERRUPTION, declared_voltage))
        self._fifteen: list[Aggregate] = []  # with the one that the last tick has cut
        self._ticks = TickValues()
        self._frequency = TenSeconds()
        self._telegrams = (
            TelegramRecorder(options.signalling_threshold * declared_voltage, options.signalling_s)
            if options.signalling_threshold is not None
            else None
        )

    def feed(self, block: SampleBlock) -> Iterator[QualityValues]:
        """Values that `block` completes: "10/12", and the longer ones as they end."""
        for interval in self._cutter.feed(block):
            values = measure(interval, self._declared, self._options)
            if not interval.trailing:
                yield from self._ticks.add(values)
                yield values if self._telegrams is None else self._telegrams.noted(values)
                yield from self._frequency.add(values)
            yield from self._cycles(interval, values)

    def _cycles(self, interval: Interval, values: QualityValues) -> Iterator[QualityValues]:
        """150/180-cycle values: fifteen intervals of one chain each."""
        if interval.first_of_chain and not interval.trailing:
            if "gap" in values.flags:  # what was in progress stays short
                yield from (short.close("gap") for short in self._fifteen if short.count)
                self._fifteen.clear()
            self._fifteen = [cut for cut in self._fifteen[-1:] if cut.count]
            self._fifteen.append(Aggregate("150/180"))
        current = self._fifteen[-2 if interval.trailing else -1]
        current.add(values)
        if current.count == FIFTEEN:
            self._fifteen.remove(current)
            yield current.close()
            if not interval.trailing:
                self._fifteen.append(Aggregate("150/180"))
