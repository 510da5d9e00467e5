"""Phase jumps, drifts and interharmonics: f is right, or null and flagged."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from acqd.metering import Meter, SampleBlock, StreamFormat
from tests.mains import EN50160

RATE = 20_000.0
SCALE = (0.0225, 0.000281)


def codes_of(turns, phases, interharmonic=(0.0, 72.0)):
    """u with EN 50160 harmonics and noise, i a sine; `turns` of the fundamental since the start."""
    random = np.random.default_rng(0)
    t = np.arange(len(turns)) / RATE
    share, f = interharmonic
    columns = []
    for phase in range(phases):
        angle = 2 * np.pi * (turns - phase / 3)
        u = np.cos(angle) + sum(level * np.cos(h * angle + h) for h, level in EN50160.items())
        u += 0.001 * random.standard_normal(len(turns)) + share * np.cos(2 * np.pi * f * t)
        columns += [u * 325 / SCALE[0], np.cos(angle - 0.5) * 4.2 / SCALE[1]]
    return np.rint(np.array(columns).T).astype(np.int16)


def metered(codes, cuts=()):
    meter = Meter(StreamFormat(RATE, SCALE * (codes.shape[1] // 2)))
    edges = [0, *cuts, len(codes)]
    return [
        batch for a, b in itertools.pairwise(edges) if (batch := meter.feed(SampleBlock(codes[a:b], a, 0))) is not None
    ]


def transient(batch):
    return np.array(["transient" in flags for flags in batch.flags[0]])


@pytest.mark.parametrize("phases", [1, 3])
@pytest.mark.parametrize("degrees", [5, -10, 20, -60])
def test_no_phase_jump_leaves_a_wrong_f_without_a_flag(phases, degrees):
    t = np.arange(16_000) / RATE
    for at in 0.4 + 0.04 * np.linspace(0, 1, 9):
        (batch,) = metered(codes_of(50.07 * t + degrees / 360 * (t >= at), phases))
        flagged, window = transient(batch), int(at / 0.04)
        assert np.isnan(batch.f[flagged]).all()
        assert set(np.flatnonzero(flagged)) <= {window, window + 1, window + 2}
        assert np.abs(batch.f[1:][~flagged[1:]] - 50.07).max() < 0.010
        assert np.abs(batch.Vrms[:, 1:] / batch.Vrms[0, 1] - 1)[:, ~flagged[1:]].max() < 0.001


@pytest.mark.parametrize("phases", [1, 3])
def test_the_voltage_in_the_window_of_a_phase_jump_is_of_the_cycle_without_it(phases):
    t, errors = np.arange(16_000) / RATE, []
    for at in 0.4 + 0.04 * np.linspace(0.05, 0.95, 10):
        (batch,) = metered(codes_of(50.02 * t + 30 / 360 * (t >= at), phases))
        errors.append(np.abs(batch.Vrms[:, int(at / 0.04)] / batch.Vrms[0, 1] - 1).max())
    assert np.median(errors) < 0.001 and np.mean(np.array(errors) < 0.003) >= 0.8


@pytest.mark.parametrize("share", [0.95, 0.7, 0.3])
def test_a_voltage_step_is_part_of_the_rms_of_its_window(share):
    t = np.arange(16_000) / RATE
    for at in 0.4 + 0.04 * np.linspace(0.05, 0.95, 7):
        codes = codes_of(50.0 * t, 3).astype(float)
        codes[:, 0::2] *= np.where(t >= at, share, 1)[:, None]
        (batch,) = metered(np.rint(codes).astype(np.int16))
        exact = np.sqrt(np.square(np.rint(codes[8_000:8_800, 0::2])).mean(axis=0)) * SCALE[0]
        assert batch.Vrms[:, 10] == pytest.approx(exact, rel=0.002)


@pytest.mark.parametrize(("slope", "phases"), [(1.0, 1), (1.0, 3), (-1.0, 3), (10.0, 3)])
def test_f_is_that_of_the_middle_of_the_interval(slope, phases):
    t = np.arange(24_000) / RATE
    (batch,) = metered(codes_of((50 - slope / 2) * t + slope * t * t / 2, phases))
    end = (np.arange(len(batch)) + 1) * 0.04
    middle = end - np.maximum(0.02, 1 / batch.f)
    assert np.abs(batch.f - (50 - slope / 2 + slope * middle))[5:].max() < 0.003


def swung(amplitude, beat, phases=1, seconds=2.0):
    """Rows of mains whose f is 50.03 + amplitude sin(2 pi beat t), and the mean f over the two cycles of each."""
    t = (np.arange(int(seconds * RATE)) + 0.5) / RATE

    def turns(t):
        return 50.03 * t - amplitude / (2 * np.pi * beat) * np.cos(2 * np.pi * beat * t)

    (batch,) = metered(codes_of(turns(t), phases))
    length = 2 / np.where(np.isnan(batch.f), 50.0, batch.f)
    end = (np.arange(len(batch)) + 1) * 0.04 - np.maximum(0, 0.02 - length / 2)
    return batch, (turns(end) - turns(end - length)) / length


@pytest.mark.parametrize(("amplitude", "beat"), [(0.1, 1.0), (0.1, 5.0), (0.03, 5.0), (0.5, 1.0), (0.05, 10.0)])
def test_a_swing_of_f_is_followed_within_the_two_cycles(amplitude, beat):
    batch, f = swung(amplitude, beat)
    assert np.abs(batch.f - f)[5:].max() < 0.012
    assert np.abs(batch.Vrms / np.median(batch.Vrms) - 1)[:, 5:].max() < 0.0002  # of which 0.0001 is noise


@pytest.mark.parametrize(("amplitude", "beat"), [(0.1, 10.0), (0.5, 5.0), (0.5, 10.0)])
def test_a_swing_within_two_cycles_is_flagged(amplitude, beat):
    batch, f = swung(amplitude, beat)
    silent = np.array([not flags & {"transient", "unsettled", "start"} for flags in batch.flags[0]])
    wrong = ~(np.abs(batch.f - f) < 0.010)
    assert (silent & wrong)[5:].mean() < 0.1 and wrong[5:].mean() > 0.2


@pytest.mark.parametrize("phases", [1, 3])
def test_a_step_of_f_shortly_before_the_end_of_the_cycles_is_flagged(phases):
    t = (np.arange(24_000) + 0.5) / RATE
    for before, step in ((0.006, -0.2), (0.008, 0.15)):
        at = 1.0 - before  # the end of window 24; the step moves its mean f by 30 mHz
        (batch,) = metered(codes_of(50.02 * t + step * np.maximum(t - at, 0), phases))
        flagged = ["unsettled" in flags for flags in batch.flags[0]]
        assert abs(batch.f[24] - 50.02 - step * before / 0.04) > 0.010
        assert flagged[24] and not any(flagged[:24])


def test_a_step_of_the_voltage_there_is_none():
    t = (np.arange(24_000) + 0.5) / RATE
    for before in (0.002, 0.004, 0.008):
        codes = codes_of(50.02 * t, 3).astype(float)
        codes[:, 0::2] *= np.where(t >= 1.0 - before, 0.95, 1)[:, None]
        (batch,) = metered(np.rint(codes).astype(np.int16))
        assert not any("unsettled" in flags for flags in batch.flags[0][:25])


@pytest.mark.parametrize("f", [60.0, 72.0, 105.0])
def test_interharmonics_are_flagged_where_they_mislead(f):
    t = np.arange(40_000) / RATE
    (batch,) = metered(codes_of(50.02 * t, 1, (0.02, f)))
    flagged = transient(batch)
    assert flagged[5:].all() or np.abs(batch.f[5:] - 50.02)[~flagged[5:]].max() < 0.010
    (joint,) = metered(codes_of(50.02 * t, 3, (0.02, f)))  # of one sign in all phases: they cancel
    assert np.abs(joint.f[1:] - 50.02).max() < 0.005


def test_how_the_stream_is_cut_does_not_matter():
    t = np.arange(32_000) / RATE
    codes = codes_of(50.02 * t + 0.05 * (t > 0.7), 1, (0.02, 60.0))
    (whole,), cut = metered(codes), metered(codes, range(800, 32_000, 800))
    np.testing.assert_allclose(np.concatenate([batch.Vrms for batch in cut], axis=1), whole.Vrms, rtol=5e-6)
    assert [batch.flags[0][0] for batch in cut] == whole.flags[0]


def test_steps_of_the_load_are_no_transients():
    t = np.arange(16_000) / RATE
    codes = codes_of(50.0 * t, 1).astype(float)
    codes[8_100:, 0] *= 0.99
    (batch,) = metered(np.rint(codes).astype(np.int16))
    assert not transient(batch).any() and np.abs(batch.f - 50)[1:].max() < 0.010


def test_after_a_dip_f_is_settled_at_once():
    t = (np.arange(32_000) + 0.5) / RATE
    turns = 49.83 * t + 0.03 * ((t >= 0.77) & (t < 0.93))
    codes = codes_of(turns, 1).astype(float)
    codes[:, 0] *= np.where((t >= 0.77) & (t < 0.93), 0.4, 1)
    (batch,) = metered(np.rint(codes).astype(np.int16))
    doubted = np.array([bool(flags & {"transient", "unsettled"}) for flags in batch.flags[0]])
    assert doubted[19] and not doubted[1:19].any()
    assert not doubted[26:].any() and np.abs(batch.f[26:] - 49.83).max() < 0.010
