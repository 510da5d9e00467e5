"""Streams fed to a meter in pieces."""

from __future__ import annotations

import itertools

from acqd.metering import Meter, SampleBlock, StreamFormat, WindowBatch


def meter_all(mains, *, cuts=(), **options) -> WindowBatch:
    form = StreamFormat(mains.rate, mains.scale)
    meter = Meter(form, **options)
    edges = [0, *sorted(cuts), len(mains.codes)]
    batches = [meter.feed(SampleBlock(mains.codes[a:b], a, 0)) for a, b in itertools.pairwise(edges)]
    return WindowBatch.join([batch for batch in batches if batch is not None])
