"""The 10/12-cycle values of IEC 61000-4-30."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from acqd.metering import Meter, SampleBlock
from acqd.metering.aggregate import TenTwelveCycle
from acqd.sources import load_waveform


def test_ten_cycle_values_are_gapless_and_of_ten_cycles(waveforms):
    waveform = load_waveform(waveforms / "generator_3ph" / "replay_20k_el3783.npz")
    meter, aggregator = Meter(waveform.form), TenTwelveCycle(waveform.form)
    values = []
    for start in range(0, len(waveform.codes), 7_000):
        block = SampleBlock(waveform.codes[start : start + 7_000], start, start * 50_000)
        values += aggregator.feed(block, meter.feed(block))
    assert len(values) >= 19
    for value, following in itertools.pairwise(values):
        assert value.cycles == 10 and value.duration == pytest.approx(10 / value.f)
        assert following.utc_ns - value.utc_ns == pytest.approx(value.duration * 1e9, abs=100)
    whole = waveform.codes[:, 0].astype(float) * waveform.form.scale[0]
    mean = np.sqrt(np.mean([v.Vrms[0] ** 2 for v in values]))
    assert mean == pytest.approx(np.sqrt((whole**2).mean()), rel=0.002)
