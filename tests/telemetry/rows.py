"""Rows of metered mains."""

from __future__ import annotations

from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.telemetry.row import rows_of
from tests.mains import make_mains


def some_rows(phases=3, seconds=1.0, utc_ns=1_626_164_130_123_456_789, **options):
    mains = make_mains(50.0, phases=phases, seconds=seconds, **options)
    meter = Meter(StreamFormat(20_000.0, mains.scale))
    batch = meter.feed(SampleBlock(mains.codes, 0, utc_ns))
    return meter, batch, list(rows_of(batch, "cell1", "b00t"))
