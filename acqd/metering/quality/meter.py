"""The power-quality meter: blocks of a stream in, values of all aggregation intervals out."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.aggregation import Aggregate
from acqd.metering.quality.half_cycles import INTERRUPTION
from acqd.metering.quality.intervals import FIFTEEN, TICK_NS, Interval, IntervalCutter, threshold, tick_number
from acqd.metering.quality.quantities import measure
from acqd.metering.quality.ten_seconds import TenSeconds
from acqd.metering.quality.values import QualityValues

_TWO_HOURS = 12
"""10 min values in a 2 h value."""
_WHOLE = 0.999
"""Share of its time that a 10 min or 2 h value holds, else it is flagged: "gap"."""


class QualityMeter:
    """Meters one stream; is fed the same blocks as `Meter`, and independent of it."""

    def __init__(self, form: StreamFormat, *, declared_voltage: float = 230.0) -> None:
        """`declared_voltage` [V]: for the flags of dips, swells and interruptions."""
        self.form = form
        self._declared = declared_voltage
        self._cutter = IntervalCutter(form, threshold(form, INTERRUPTION, declared_voltage))
        self._fifteen: list[Aggregate] = []  # with the one that the last tick has cut
        self._ten_minutes = Aggregate("10min")
        self._two_hours = Aggregate("2h")
        self._tick: int | None = None
        self._frequency = TenSeconds()

    def feed(self, block: SampleBlock) -> Iterator[QualityValues]:
        """Values that `block` completes: "10/12", and the longer ones as they end."""
        for interval in self._cutter.feed(block):
            values = measure(interval, self._declared)
            if not interval.trailing:
                yield from self._long(values)
                yield values
                yield from self._frequency.add(values)
            yield from self._cycles(interval, values)

    def _cycles(self, interval: Interval, values: QualityValues) -> Iterator[QualityValues]:
        """150/180-cycle values: fifteen intervals of one chain each."""
        if interval.first_of_chain and not interval.trailing:
            if "gap" in values.flags:  # what was in progress stays short
                yield from (short.close("gap") for short in self._fifteen if short.count)
                self._fifteen.clear()
            self._fifteen.append(Aggregate("150/180"))
        current = self._fifteen[0 if interval.trailing else -1]
        current.add(values)
        if current.count == FIFTEEN:
            self._fifteen.remove(current)
            yield current.close()
            if not interval.trailing:
                self._fifteen.append(Aggregate("150/180"))

    def _long(self, values: QualityValues) -> Iterator[QualityValues]:
        """10 min and 2 h values, closed by the first interval after them."""
        tick = tick_number(values.utc_ns)
        if self._tick is not None and tick != self._tick:
            ten = self._close(self._ten_minutes, 1)
            self._ten_minutes = Aggregate("10min")
            yield ten
            self._two_hours.add(ten)
            if tick // _TWO_HOURS != self._tick // _TWO_HOURS:
                yield self._close(self._two_hours, _TWO_HOURS)
                self._two_hours = Aggregate("2h")
        self._tick = tick
        self._ten_minutes.add(values)

    def _close(self, aggregate: Aggregate, ticks: int) -> QualityValues:
        short = aggregate.covered < _WHOLE * ticks * TICK_NS * 1e-9
        return aggregate.close("gap") if short else aggregate.close()
