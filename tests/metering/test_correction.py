"""Correction of channels: closed forms, any cut into blocks, gaps."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.daemon.correction_section import CorrectionSection
from acqd.errors import UserError
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.correction import ChannelErrors, Correction

RATE = 20_000.0
FORM = StreamFormat(RATE, (0.02, 0.0003))
SPOILED = ChannelErrors([1.0, 1 / 1.01], [0.0, 0.02], [0.0, 10e-6])


def codes(n, errors=None, lag=np.pi / 3):
    """230 V and 2 A at a power factor of 0.5, as transformers with `errors` pass them on."""
    wrong = errors or ChannelErrors([1.0, 1.0], [0.0, 0.0], [0.0, 0.0])
    t = [n / RATE - delay for delay in wrong.delay_s]
    u = 230 * np.sqrt(2) * np.sin(2 * np.pi * 50 * t[0]) / wrong.gain[0] + wrong.offset[0]
    i = 2 * np.sqrt(2) * np.sin(2 * np.pi * 50 * t[1] - lag) / wrong.gain[1] + wrong.offset[1]
    return np.round(np.stack((u / FORM.scale[0], i / FORM.scale[1]), axis=1)).astype(np.int16)


def metered(blocks, form):
    meter = Meter(form)
    batches = [meter.feed(block) for block in blocks]
    return np.concatenate([batch.P[0] for batch in batches if batch is not None]), meter


def cut(samples, sizes, index=0):
    """Blocks of these sizes, again and again."""
    at = k = 0
    while at < len(samples):
        part = samples[at : at + sizes[k % len(sizes)]]
        yield SampleBlock(part, index + at, 10**18 + round((index + at) * 1e9 / RATE))
        at, k = at + len(part), k + 1


def corrected(correction, blocks):
    return [done for block in blocks if (done := correction.apply(block)) is not None]


def test_a_delay_of_a_current_transformer_costs_energy_until_it_is_corrected():
    samples = codes(np.arange(40_000), SPOILED)
    spoiled, _ = metered(cut(samples, [200]), FORM)
    assert abs(spoiled.mean() / 230 - 1) > 0.004
    correction = Correction(FORM, SPOILED)
    P, meter = metered(corrected(correction, cut(samples, [200])), correction.form)
    assert np.abs(P / 230 - 1).max() < 1e-4  # class 0.2 S allows 0.2 %, and a twentieth of that is this
    assert sum(pair[0] for pair in meter.energy.reading()) == pytest.approx(230 * 0.04 * len(P) / 3.6e6, rel=1e-4)


@settings(max_examples=40)
@given(st.lists(st.integers(1, 700), min_size=1, max_size=5), st.floats(-900, 900), st.floats(-900, 900))
def test_any_cut_into_blocks_gives_the_same_samples(sizes, u_us, i_us):
    samples = codes(np.arange(3_000))
    errors = ChannelErrors([1.0, 1.0], [0.5, 0.0], [u_us * 1e-6, i_us * 1e-6])
    (whole,) = corrected(Correction(FORM, errors), cut(samples, [3_000]))
    parts = corrected(Correction(FORM, errors), cut(samples, sizes))
    np.testing.assert_allclose(np.concatenate([part.codes for part in parts]), whole.codes, atol=1e-9)
    assert parts[0].index == whole.index and all(not part.lost for part in parts)
    assert all(a.index + len(a.codes) == b.index for a, b in itertools.pairwise(parts))
    for part in parts:
        assert part.utc_ns == pytest.approx(10**18 + part.index * 1e9 / RATE, abs=1)


@given(st.floats(-900, 900), st.floats(-900, 900))
def test_late_channels_come_back_into_place(u_us, i_us):
    errors = ChannelErrors([1.0, 1.0], [0.0, 0.0], [u_us * 1e-6, i_us * 1e-6])
    (block,) = corrected(Correction(FORM, errors), cut(codes(np.arange(2_000), errors), [2_000]))
    true = codes(np.arange(block.index, block.index + len(block.codes)))
    assert np.abs(block.codes - true).max() < 1.6  # both are rounded to codes


def test_a_gap_grows_by_the_samples_that_have_no_neighbours_and_overrange_is_seen():
    correction = Correction(FORM, SPOILED)
    samples = codes(np.arange(4_000), SPOILED)
    blocks = [*cut(samples[:1_000], [500]), *cut(samples[2_000:], [500], 2_000)]
    blocks[3].codes[10] = 32767
    done = corrected(correction, blocks)
    gap = done[2].index - done[1].index - len(done[1].codes)
    assert done[2].lost == gap == 1_000 + 7
    assert ["overrange" in block.flags for block in done] == [False, False, False, True, False, False]


def test_the_flags_of_a_block_without_corrected_samples_come_with_the_next_one():
    correction = Correction(FORM, SPOILED)
    blocks = list(cut(codes(np.arange(100)), [3, 50]))
    first = SampleBlock(blocks[0].codes, 0, blocks[0].utc_ns, flags=frozenset({"clock_step"}))
    assert correction.apply(first) is None
    assert correction.apply(blocks[1]).flags == {"clock_step"} and not correction.apply(blocks[2]).flags


def test_gains_alone_leave_the_codes_as_they_are():
    correction = CorrectionSection(u_gain=[2.0], i_gain=[0.5]).of(FORM)
    block = next(cut(codes(np.arange(100)), [100]))
    assert correction.apply(block) is block and correction.form.bits == 16
    assert correction.form.scale == (0.04, 0.00015) and CorrectionSection().of(FORM) is None


def test_values_that_do_not_fit_the_phases_are_named():
    with pytest.raises(UserError, match=r"source\.correction\.i_delay_us: 3 values, but the source has 1 phases"):
        CorrectionSection(i_delay_us=[1.0, 2.0, 3.0]).of(FORM)
