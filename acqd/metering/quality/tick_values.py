"""10 min and 2 h values, which end with the ticks of UTC (IEC 61000-4-30:2015, section 4.5)."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.metering.quality.aggregation import Aggregate
from acqd.metering.quality.intervals import TICK_NS, tick_number
from acqd.metering.quality.values import QualityValues

_TWO_HOURS = 12
"""10 min values in a 2 h value."""
_WHOLE = 0.999
"""Share of its time that a value holds, else it is flagged: "gap"."""


class TickValues:
    """Collects 10/12-cycle values; one that begins before a tick belongs to the time before it."""

    def __init__(self) -> None:
        self._ten_minutes, self._two_hours = Aggregate("10min"), Aggregate("2h")
        self._tick: int | None = None

    def add(self, values: QualityValues) -> Iterator[QualityValues]:
        """Take the next interval; the longer values that ended before it."""
        tick = tick_number(values.utc_ns)
        if self._tick is not None and tick != self._tick:
            ten = _closed(self._ten_minutes, 1)
            self._ten_minutes = Aggregate("10min")
            yield ten
            self._two_hours.add(ten)
            if tick // _TWO_HOURS != self._tick // _TWO_HOURS:
                yield _closed(self._two_hours, _TWO_HOURS)
                self._two_hours = Aggregate("2h")
        self._tick = tick
        self._ten_minutes.add(values)


def _closed(aggregate: Aggregate, ticks: int) -> QualityValues:
    short = aggregate.covered < _WHOLE * ticks * TICK_NS * 1e-9
    return aggregate.close("gap") if short else aggregate.close()
