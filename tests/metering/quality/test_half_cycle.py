"""Urms(1/2): one value per half cycle of each channel, of exactly one cycle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.metering.quality.half_cycle import HalfCycleStream
from tests.mains import EN50160
from tests.metering.quality.disturbed import RATE, blocks, form, voltages


def values_of(u, *, cuts=None, f_nominal=50.0):
    """begin, end and Urms of every phase; None where a run ends."""
    stream, runs = HalfCycleStream(form(u.shape[1], f_nominal)), [[]]
    for block in blocks(u, cuts):
        for values in stream.feed(block):
            runs[-1].append(values)
    return [
        tuple(np.concatenate([getattr(one, name)[k] for one in runs[0]]) for name in ("begin", "end", "Urms"))
        for k in range(u.shape[1])
    ]


@pytest.mark.parametrize(("f", "f_nominal"), [(42.6, 50), (49.1, 50), (50, 50), (50.3, 50), (57.4, 50), (61, 60)])
def test_a_steady_voltage_has_its_rms_in_every_half_cycle(f, f_nominal):
    for begin, end, Urms in values_of(voltages(lambda t, _: 1.0 + 0 * t, f=f), f_nominal=f_nominal):
        assert len(Urms) == pytest.approx(2 * f * 4, abs=6)
        assert Urms == pytest.approx(230, rel=2e-3)  # 0.2 % of Udin: class A
        assert Urms[40:] == pytest.approx(230, rel=3e-4)
        assert np.diff(begin)[40:] == pytest.approx(RATE / f / 2, rel=2e-3)
        assert end[:-2] == pytest.approx(begin[2:], abs=0.5)  # a cycle begins where another one has ended


def test_cycles_begin_at_zero_crossings_of_the_fundamental_whatever_the_harmonics():
    f, t = 50.2, np.arange(40_000) / RATE
    u = 325 * (np.sin(2 * np.pi * f * t) + sum(a * np.sin(2 * np.pi * f * k * t + k) for k, a in EN50160.items()))
    ((begin, _, Urms),) = values_of((u + 3.0)[:, None])
    angle = 2 * f * begin / RATE
    assert np.abs(angle - np.rint(angle)).max() * 180 < 3  # degrees
    true = np.sqrt(325**2 / 2 * (1 + sum(a * a for a in EN50160.values())) + 9)
    assert Urms == pytest.approx(true, rel=1e-3)


def test_an_interruption_has_values_of_zero_and_the_clock_runs_on():
    for begin, _, Urms in values_of(voltages(lambda t, _: np.where((t > 1) & (t < 2), 0.0, 1.0), f=50.1)):
        dark = (begin > 10_000) & (begin < 19_700)
        assert np.count_nonzero(dark) == pytest.approx(97, abs=2)
        assert Urms[dark] == pytest.approx(0, abs=1e-6)
        assert Urms[begin > 20_000] == pytest.approx(230, rel=2e-3)


@settings(max_examples=25)
@given(st.lists(st.integers(1, 9_999), max_size=30, unique=True))
def test_the_values_do_not_depend_on_how_the_stream_is_cut(cuts):
    u = voltages(lambda t, k: np.where(t > 0.5, 0.6 + 0.1 * k, 1.0), seconds=1.0, f=49.7)
    for (begin, _, Urms), (other_begin, _, other) in zip(values_of(u), values_of(u, cuts=sorted(cuts)), strict=True):
        assert begin == pytest.approx(other_begin, abs=1e-6) and Urms == pytest.approx(other, abs=1e-6)


def test_memory_does_not_grow_and_a_gap_ends_a_run():
    u = voltages(lambda t, _: 1.0 + 0 * t)
    stream = HalfCycleStream(form())
    for block in blocks(u):
        list(stream.feed(block))
    assert len(stream._codes) < 3 * RATE / 50
    broken, after = list(stream.feed(next(blocks(u, [4_000], index=len(u) + 7))))
    assert broken.last and not len(broken)
    assert after.first and after.begin[0][0] >= len(u) + 7
