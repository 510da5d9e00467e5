"""Windows without mains: the same rows as with a search for f, without its cost."""

from __future__ import annotations

import time

import numpy as np
import pytest

from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.kernel import Kernel
from acqd.metering.reference_path import ReferencePath
from tests.mains import make_mains

SCALE = (737.2575 / 32768, 9.207527 / 32768) * 3


def noisy(windows: int) -> np.ndarray:
    """3 LSB of noise on all channels, with mains for 20 windows in the middle."""
    codes = np.random.default_rng(1).normal(0, 3, (800 * windows, 6))
    mains = make_mains(50.0, seconds=0.8).codes
    begin = 400 * windows
    codes[begin : begin + len(mains)] += mains
    return np.rint(codes).astype(np.int16)


def feed(meter, codes, count=800):
    blocks = (SampleBlock(codes[k : k + count], k, k * 50_000) for k in range(0, len(codes), count))
    return [batch for batch in map(meter.feed, blocks) if batch is not None]


@pytest.mark.parametrize("mode", ["synchronous", "fixed"])
def test_rows_without_mains_are_those_of_the_long_way(monkeypatch, mode):
    codes = noisy(120)
    quicks = [feed(Meter(StreamFormat(20_000.0, SCALE), mode=mode), codes, count) for count in (800, 16_000)]
    monkeypatch.setattr(Kernel, "meter_quiet", lambda *_: None)
    monkeypatch.setattr(ReferencePath, "_without_mains", lambda *_: None)
    for count, quick in zip((800, 16_000), quicks, strict=True):
        long = feed(Meter(StreamFormat(20_000.0, SCALE), mode=mode), codes, count)
        for name in ("Vrms", "Irms", "P", "f", "imported", "exported"):
            a, b = (np.concatenate([getattr(one, name) for one in made], axis=-1) for made in (quick, long))
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12, err_msg=name)
        assert [f for one in quick for f in one.flags[1]] == [f for one in long for f in one.flags[1]]


@pytest.mark.parametrize("count", [800, 16_000])
def test_dead_mains_cost_no_more_than_live_ones(count):
    """The search for f cost a hundred times as much, windows of a recording one by one nine times as much; the limit
    leaves room for a busy machine."""
    live = make_mains(50.0, seconds=8.0).codes
    dead = np.random.default_rng(1).normal(0, 3, live.shape)
    took = []
    for codes in (live, np.rint(dead).astype(np.int16), np.rint(dead + 0.04 * live).astype(np.int16)):
        meter = Meter(StreamFormat(20_000.0, SCALE))
        assert not np.isfinite(feed(meter, codes[:16_000])[-1].f[0]) or codes is live
        blocks = [SampleBlock(codes[k : k + count], k, k * 50_000) for k in range(16_000, len(codes), count)]
        each = []
        for block in blocks:
            begun = time.perf_counter()
            meter.feed(block)
            each.append(time.perf_counter() - begun)
        took.append(float(np.median(each)))
    assert max(took[1:]) < 2 * took[0]
