"""Frequency of every 10 s of UTC (IEC 61000-4-30:2015, section 5.1).

The standard divides whole cycles by their duration. The same is the mean of f over the time: the 10/12-cycle intervals
hold whole cycles and follow each other without gaps, and of one that a 10 s bound cuts the part is taken by its f and
rate of change.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from acqd.metering.quality.values import QualityValues

TEN_NS = 10 * 10**9
_ENOUGH = 0.98
"""Share of the 10 s with a known f; with less there is no value."""


class TenSeconds:
    """Collects 10/12-cycle values."""

    def __init__(self) -> None:
        self._slot: int | None = None
        self._cycles = self._known = 0.0
        self._covered = self._phases = 0
        self._flags: set[str] = set()

    def add(self, values: QualityValues) -> Iterator[QualityValues]:
        """Take the next interval; the value of the 10 s that it completes."""
        self._phases = len(values.phase_flags)
        begin, end = values.utc_ns, values.utc_ns + round(values.duration * 1e9)
        begin = max(begin, self._covered)  # at a ten-minute tick intervals overlap
        self._covered = max(self._covered, end)
        while begin < end:
            slot = begin // TEN_NS
            if self._slot is not None and slot != self._slot:
                yield self._close()
            self._slot = slot
            stop = min(end, (slot + 1) * TEN_NS)
            self._take(values, begin, stop)
            begin = stop

    def _take(self, values: QualityValues, begin: int, stop: int) -> None:
        self._flags |= values.flags
        if math.isnan(values.f):
            return
        seconds = (stop - begin) * 1e-9
        middle = ((begin - values.utc_ns) + (stop - values.utc_ns)) * 0.5e-9 - values.duration / 2
        slope = 0.0 if math.isnan(values.rocof) else values.rocof
        self._cycles += (values.f + slope * middle) * seconds
        self._known += seconds

    def _close(self) -> QualityValues:
        assert self._slot is not None
        whole = self._known >= _ENOUGH * 10
        values = QualityValues(
            kind="10s",
            utc_ns=self._slot * TEN_NS,
            duration=10.0,
            intervals=0,
            f=self._cycles / self._known if whole else math.nan,
            rocof=math.nan,
            phase={},
            system={},
            flags=frozenset(self._flags if whole else self._flags | {"gap"}),
            phase_flags=[frozenset()] * self._phases,
        )
        self._cycles = self._known = 0.0
        self._flags.clear()
        return values
