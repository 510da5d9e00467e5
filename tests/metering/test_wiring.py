"""Two wattmeters: the power of three phases, whatever the load."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.daemon.source_sections import SimulatedSection
from acqd.errors import UserError
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.stages import Stages

FORM = StreamFormat(20_000.0, (0.02, 0.0003, 0.02, 0.0003))
T = np.arange(20_000) / 20_000
ARON = SimulatedSection(wiring="aron")


def three_wires(amplitudes, lags):
    """Star voltages and currents [3, T] of a source and a load without neutral, with a fifth harmonic."""
    turns = 2 * np.pi * (50 * T - np.arange(3)[:, None] / 3)
    u = 325 * np.sin(turns) + 10 * np.sin(5 * turns)
    i = np.array(amplitudes)[:, None] * np.sin(turns - np.array(lags)[:, None])
    return u, i - i.mean(axis=0)


def two_pairs(u, i):
    """Codes of u12, i1, u32, i3."""
    return np.round(np.stack((u[0] - u[1], i[0], u[2] - u[1], i[2])).T / FORM.scale).astype(np.int16)


def metered(codes):
    stages = Stages(FORM, ARON.makers)
    meter = Meter(stages.form)
    return meter.feed(stages.apply(SampleBlock(codes, 0, 10**18)))


@given(st.lists(st.floats(0.5, 5), min_size=3, max_size=3), st.lists(st.floats(-1.5, 1.5), min_size=3, max_size=3))
def test_the_power_of_two_wattmeters_is_that_of_three_phases(amplitudes, lags):
    u, i = three_wires(amplitudes, lags)
    batch = metered(two_pairs(u, i))
    expected = (u * i).mean(axis=1)
    assert batch.P[:, 5:].sum(axis=0) == pytest.approx(expected.sum(), rel=1e-4, abs=0.2)
    assert np.abs(batch.P[:, 5:] - expected[:, None]).max() < 0.3
    assert np.abs(batch.Irms[:, 5:] / np.sqrt((i**2).mean(axis=1))[:, None] - 1).max() < 1e-3
    assert np.abs(batch.Vrms[:, 5:] / np.sqrt((u**2).mean(axis=1))[:, None] - 1).max() < 1e-4
    assert all("derived" in flags for phase in batch.flags for flags in phase)


def test_overrange_of_a_wattmeter_is_seen_and_other_numbers_of_channels_are_refused():
    codes = two_pairs(*three_wires([1, 1, 1], [0, 0, 0]))
    codes[100, 1] = 32767
    assert "overrange" in metered(codes).flags[0][0]
    with pytest.raises(UserError, match="needs two pairs of channels, but the source has 3 phases"):
        Stages(StreamFormat(20_000.0, (0.02, 0.0003) * 3), ARON.makers)
