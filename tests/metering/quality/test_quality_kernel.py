"""The functions of `quality.c` against numpy, and without a read outside of their arrays."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.c_builds import quality
from acqd.compiling import system_compiler
from acqd.instruction_sets import best_instruction_set
from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.kernel.compiled import quality_library
from acqd.metering.quality import cycles as cycle_fits
from acqd.metering.quality import mean_squares as mean_square_values
from acqd.metering.quality import run as run_of_samples
from acqd.metering.quality.detector import EventDetector
from acqd.metering.quality.half_cycle import HalfCycleStream
from acqd.metering.quality.integrals import half_cycle_integrals, half_cycle_integrals_by_numpy
from acqd.metering.quality.linear_filter import LinearFilter, bilinear, butterworth
from acqd.metering.quality.mean_squares import mean_squares_of_codes
from acqd.metering.quality.reference import Declared
from acqd.metering.quality.resample import MARGIN, SHORT, STOPBAND, WIDE, resampled, resampled_by_numpy
from acqd.metering.quality.run import SampleRun
from acqd.metering.quality.spectrum import groups, groups_by_numpy

X = np.random.default_rng(4).normal(0, 300, (6, 700))
compiled = pytest.mark.skipif(system_compiler() is None, reason="no C compiler")


def alike(one, other):
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


@compiled
@settings(max_examples=40, deadline=None)
@given(
    start=st.floats(MARGIN, 60.0), step=st.floats(0.2, 1.4), count=st.integers(1, 400), channels=st.integers(1, 6),
    how=st.sampled_from([WIDE, SHORT]),
)  # fmt: skip
def test_resampling_agrees_to_rounding(start, step, count, channels, how):
    x = X[:channels]
    assert quality_library() is not None
    alike(resampled(x, start, step, count, how), resampled_by_numpy(x, start, step, count, how))


@pytest.mark.parametrize("how", [WIDE, SHORT])
def test_interpolation_keeps_the_passband_and_damps_images(how):
    fraction, tap = np.arange(how.steps)[:, None] / how.steps, np.arange(how.taps)
    distance = (tap - (how.taps // 2 - 1) - fraction).ravel()
    weights = how.rows[: how.steps].ravel() / how.steps

    def response(shares):  # of the sampling rate
        return np.abs(np.exp(-2j * np.pi * np.outer(shares, distance)) @ weights)

    np.testing.assert_allclose(response(np.linspace(0, how.passband, 40)), 1, atol=10 ** (-90 / 20))
    assert response(np.linspace(STOPBAND, 3, 200)).max() < 10 ** (-90 / 20)


@compiled
@settings(max_examples=40, deadline=None)
@given(start=st.floats(0, 40), half=st.floats(1.0, 32.5), halves=st.integers(1, 20), phases=st.integers(1, 3))
def test_integrals_of_half_cycles_agree_to_rounding(start, half, halves, phases):
    x = X[: 2 * phases, 3:]  # rows with a distance
    one, other = (
        integrals(x, start, half, halves) for integrals in (half_cycle_integrals, half_cycle_integrals_by_numpy)
    )
    for name in ("squares", "products", "lines", "neutral", "peaks"):
        assert getattr(one, name).shape == getattr(other, name).shape
        alike(getattr(one, name), getattr(other, name))
    alike(one.one_cycle_rms(), other.one_cycle_rms())


@compiled
@settings(max_examples=40, deadline=None)
@given(start=st.floats(1, 60), length=st.floats(4.0, 60.0), cycles=st.sampled_from([10, 12]))
def test_sums_of_cycles_agree_to_rounding(start, length, cycles):
    u = X[0::2]
    if start + cycles * length + 1 > u.shape[1]:
        return
    same_phasors(u, start, length, cycles)


def same_phasors(u, start, length, cycles):
    one, other = (
        make(u, start, 1000 / length, 1000.0, cycles)
        for make in (cycle_fits.cycle_phasors, cycle_fits.cycle_phasors_by_numpy)
    )
    alike(one[0], other[0])
    alike(np.exp(1j * one[1]), np.exp(1j * other[1]))  # half a turn may be one to the right or to the left
    alike(one[2], other[2])


@compiled
@settings(max_examples=20, deadline=None)
@given(cycles=st.sampled_from([10, 12]), channels=st.integers(1, 6), known=st.integers(0, 50), seed=st.integers(0, 99))
def test_groups_of_lines_agree_to_rounding(cycles, channels, known, seed):
    random = np.random.default_rng(seed)
    lines = random.normal(size=(channels, 51 * cycles + 1)) + 1j * random.normal(size=(channels, 51 * cycles + 1))
    lines[0] = 0
    for one, other in zip(groups(lines, cycles, known), groups_by_numpy(lines, cycles, known), strict=True):
        alike(one, other)


@compiled
@pytest.mark.parametrize(("bits", "kind"), [(16, np.int16), (32, np.int32), (64, np.float64)])
def test_codes_are_converted_as_numpy_does(bits, kind, monkeypatch):
    form = StreamFormat(10_000.0, (0.02, 0.001) * 3, bits=bits)
    codes = np.random.default_rng(2).integers(-30_000, 30_000, (640, 6)).astype(kind)
    run = SampleRun(form)
    run.append(SampleBlock(codes, 100, 0))
    found = []
    for library in (quality_library(), None):
        with monkeypatch.context() as patch:
            for module in (run_of_samples, mean_square_values):
                patch.setattr(module, "quality_library", lambda library=library: library)
            found.append((*run.physical(103.5, 607.2), mean_squares_of_codes(codes, form, 10)))
    assert np.array_equal(found[0][0], found[1][0]) and found[0][1] == found[1][1] == 103
    alike(found[0][2], found[1][2])


def disturbed(seconds, rate, seed):
    """Voltages with dips, an interruption, noise and a phase jump."""
    random, t = np.random.default_rng(seed), np.arange(round(seconds * rate)) / rate
    angle = 2 * np.pi * 49.7 * t + 0.9 * (t > 1.1)
    columns = []
    for k in range(3):
        factor = np.where((t > 0.4) & (t < 0.4 + 0.1 * k), 0.6, 1.0) * np.where((t > 0.8) & (t < 0.95), 0.01, 1.0)
        u = 10_000 * factor * np.sin(angle - 2 * np.pi * k / 3) + 5 * random.standard_normal(len(t))
        columns += [u, np.zeros(len(t))]
    return np.rint(np.array(columns).T)


@compiled
@pytest.mark.parametrize(("bits", "kind"), [(16, np.int16), (32, np.int32), (64, np.float64)])
def test_half_cycles_agree_to_rounding(bits, kind):
    form = StreamFormat(10_000.0, (0.02, 0.001) * 3, bits=bits)
    codes, streams = (
        disturbed(1.5, form.rate, 1).astype(kind),
        [HalfCycleStream(form, compiled=c) for c in (True, False)],
    )
    seen = 0
    for k in range(0, len(codes), 390):
        pair = [list(stream.feed(SampleBlock(codes[k : k + 390], k, 0))) for stream in streams]
        for one, other in zip(*pair, strict=True):
            seen += len(one)
            for name in ("begin", "end", "Urms", "late"):
                for column, wanted in zip(getattr(one, name), getattr(other, name), strict=True):
                    alike(column, wanted)
    assert seen > 400


@compiled
@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(1, 699), max_size=4, unique=True), order=st.sampled_from([2, 6]))
def test_filters_agree_to_rounding(cuts, order):
    sections = [bilinear([1.0, 0.0], [1.0, 0.3], 2_000.0), *butterworth(order, 35.0, 2_000.0)]
    one, other = LinearFilter(sections, 3), LinearFilter(sections, 3)
    for part in (one, other):
        part.settle(np.array([1.0, 2.0, 3.0]))
    for u in np.split(X[:3], sorted(cuts), axis=1):
        alike(one.feed(u), other.feed_by_numpy(u))
    alike(one._state, other._state)


@compiled
def test_arrays_of_any_layout_are_taken():
    """Such as physical values of codes, whose channels lie next to each other."""
    for x in (np.asfortranarray(X), X[:, ::-1], X[::-1]):
        alike(resampled(x, 40.0, 0.9, 100), resampled_by_numpy(x, 40.0, 0.9, 100))
        alike(half_cycle_integrals(x, 3.0, 20.0, 20).squares, half_cycle_integrals_by_numpy(x, 3.0, 20.0, 20).squares)
        same_phasors(x, 2.0, 40.0, 10)
        one, other = (LinearFilter(butterworth(6, 35.0, 2_000.0), 6) for _ in range(2))
        alike(one.feed(x), other.feed_by_numpy(x))


@pytest.mark.parametrize(("seed", "length"), [(0, 400), (1, 400), (2, 400), (0, 25_000)])
def test_values_that_are_taken_at_once_lead_to_the_same_events(seed, length, monkeypatch):
    form = StreamFormat(10_000.0, (0.03, 0.001) * 3)
    codes, found = disturbed(8.0, form.rate, seed).astype(np.int16), []
    codes[65_000:] = np.rint(codes[65_000:] * 0.93)  # a rapid voltage change
    for at_once in (True, False):
        with monkeypatch.context() as patch:
            if not at_once:
                patch.setattr(EventDetector, "_quiet", lambda *_: False)
            detector = EventDetector(form, Declared(212.0))
            events = [
                e
                for k in range(0, len(codes), length)
                for e in detector.feed(SampleBlock(codes[k : k + length], k, k * 10**5))
            ]
            found.append([*events, *detector.finish()])
    assert {"dip", "rvc", "interruption"} <= {event.kind for event in found[0]}
    assert found[0] == found[1]


@pytest.mark.parametrize(("start", "count"), [(10.0, 100), (MARGIN, 700)])
def test_instants_without_samples_around_them_are_refused(start, count):
    with pytest.raises(IndexError, match="samples beyond"):
        resampled(X, start, 1.0, count)


def test_without_c_numpy_computes_power_quality():
    code = "from acqd.metering.kernel.compiled import quality_library as q; print(q())"
    environment = os.environ | {"ACQD_METERING": "numpy"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "None\n"


SANITISED = """
import sys
from pathlib import Path
import numpy as np
from acqd.metering import SampleBlock, StreamFormat
from acqd.metering import look
from acqd.metering.kernel import compiled
from acqd.metering.quality import cycles, half_cycle, integrals, linear_filter, mean_squares, resample, run, spectrum
library = compiled.load_quality(Path(sys.argv[1]))
for module in (cycles, half_cycle, integrals, linear_filter, look, mean_squares, resample, run, spectrum):
    module.quality_library = lambda: library
for samples in (64, 100):
    x = np.ones((6, samples))
    for how in (resample.WIDE, resample.SHORT):
        half, count = how.taps // 2, samples - how.taps + 1
        for first in (half - 0.5, half + 0.5 - 1e-12):
            np.testing.assert_allclose(resample.resampled(x, first, 1.0, count - (first > half), how), 1)
    for phases in (1, 2, 3):
        whole = integrals.half_cycle_integrals(x[: 2 * phases].copy(), 0.0, samples / 20, 20)
        np.testing.assert_allclose(whole.squares, samples / 20)
    cycles.cycle_phasors(x[0::2], 0.0, 10.0, samples, 10)
    form = StreamFormat(2_000.0, (0.02, 0.01) * 3)
    codes = np.full((samples, 6), 7, dtype=np.int16)
    stretch = run.SampleRun(form)
    stretch.append(SampleBlock(codes, 0, 0))
    assert stretch.physical(0, samples)[0].shape == (6, samples)
    mean_squares.mean_squares_of_codes(codes, form, samples // 4)
    for kind in (np.int16, np.int32):
        for channels in (2, 4, 6):
            look.look_at(np.ones((samples, channels), dtype=kind), samples // 2 + 1)
            blocks = np.ones((5 * samples, channels), dtype=kind), samples * np.arange(6)
            usual = np.array([1.0, 1.0, 1.0, 3e4])
            assert look.Looker(channels, samples).calm(*blocks, 10**6, usual, np.ones(channels)) == 5
for count in (10, 12):
    spectrum.groups(np.ones((6, 51 * count + 1), dtype=complex), count, 50)
linear_filter.LinearFilter(linear_filter.butterworth(32, 35.0, 2_000.0), 3).feed(x[:3])
random = np.random.default_rng(0)
for bits, kind in ((16, np.int16), (32, np.int32), (64, np.float64)):
    stream = half_cycle.HalfCycleStream(StreamFormat(2_000.0, (0.02, 0.01) * 3, bits=bits))
    for k in range(0, 2_000, 80):
        codes = random.integers(-3_000, 3_000, (80, 6)).astype(kind)
        if bits == 64 and k == 800:
            codes[:] = np.nan
        list(stream.feed(SampleBlock(codes, k, 0)))
print("clean")
"""


@compiled
def test_no_read_outside_the_samples_and_no_undefined_behaviour(tmp_path):
    compiler = system_compiler()
    runtime = subprocess.run([compiler, "-print-file-name=libasan.so"], capture_output=True, text=True).stdout.strip()
    if not Path(runtime).is_absolute():
        pytest.skip("no address sanitizer")
    built, build = tmp_path / "quality.so", quality(best_instruction_set())
    flags = ["-O1", "-g", "-std=gnu11", "-fPIC", "-shared", "-w", "-fsanitize=address,undefined"]
    subprocess.run([compiler, *flags, "-fno-sanitize-recover=all", build.sources[0], "-o", built, "-lm"], check=True)
    environment = os.environ | {"LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"}
    command = [sys.executable, "-c", SANITISED, str(built)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=build.sources[0].parents[3])
    assert done.stdout == "clean\n", done.stderr[-3_000:]
