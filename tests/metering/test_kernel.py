"""The kernel in C against numpy."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.c_builds import window
from acqd.compiling import system_compiler
from acqd.instruction_sets import INSTRUCTION_SETS, best_instruction_set
from acqd.metering import Meter, SampleBlock, StreamFormat, WindowBatch
from acqd.metering.kernel import why_not
from acqd.metering.kernel.compiled import library
from tests.mains import EN50160, make_mains

pytestmark = pytest.mark.skipif(system_compiler() is None, reason="no C compiler")
COLUMNS = ("f", "Vrms", "Irms", "P", "imported", "exported", "Q1")


def window_by_window(form, codes, **options):
    """Each window's trial is the f of the last: then both paths take the same steps."""
    meter = Meter(form, **options)
    size = round(0.04 * form.rate)
    batches = [meter.feed(SampleBlock(codes[k : k + size], k, 0)) for k in range(0, len(codes), size)]
    return WindowBatch.join([batch for batch in batches if batch is not None])


def assert_equal(one, other, rtol=1e-9):
    for name in COLUMNS:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=rtol, atol=1e-12, err_msg=name)
    assert one.flags == other.flags


@settings(max_examples=12, deadline=None)
@given(
    phases=st.integers(1, 3),
    f=st.floats(45.2, 64.8),
    rate=st.sampled_from([20_000.0, 4_000.0, 7_812.5]),
    mode=st.sampled_from(["synchronous", "fixed"]),
    bits=st.sampled_from([16, 32, 64]),
    fault=st.sampled_from(["none", "dead phase", "over range", "interruption", "jump"]),
    seed=st.integers(0, 1_000),
)
def test_both_paths_are_equal(phases, f, rate, mode, bits, fault, seed):
    mains = make_mains(f, seconds=0.44, rate=rate, phases=phases, harmonics=EN50160, noise=0.001, dc=0.01, seed=seed)
    codes, here = mains.codes, int(0.21 * rate)
    if fault == "dead phase":
        codes[:, -2] = 0
    elif fault == "over range":
        codes[here, -1] = 32_767
    elif fault == "interruption":
        codes[here : here + int(0.1 * rate)] = 0
    elif fault == "jump":
        codes[here:] = np.roll(codes[here:], 40, axis=0)
    form = StreamFormat(rate, mains.scale, bits=bits)
    codes = np.ascontiguousarray(codes.astype(form.dtype))
    assert_equal(window_by_window(form, codes, mode=mode), window_by_window(form, codes, mode=mode, compiled=False))


def test_samples_that_are_not_contiguous_or_of_another_type():
    mains = make_mains(50.03, seconds=0.4, noise=0.001)
    form = StreamFormat(20_000.0, mains.scale[:2])
    plain = window_by_window(form, np.ascontiguousarray(mains.codes[:, 2:4]))
    assert_equal(window_by_window(form, mains.codes[:, 2:4]), plain)
    assert_equal(window_by_window(form, mains.codes[:, 2:4].astype(np.int64)), plain)


def test_every_instruction_set_gives_the_same(monkeypatch):
    mains = make_mains(50.03, seconds=0.4, noise=0.001, harmonics=EN50160)
    form = StreamFormat(20_000.0, mains.scale)
    reference = window_by_window(form, mains.codes, compiled=False)
    for instructions in INSTRUCTION_SETS:
        if instructions.lanes <= best_instruction_set().lanes:
            monkeypatch.setenv("ACQD_METERING", str(library(6, instructions)._name))
            assert_equal(window_by_window(form, mains.codes), reference)
            monkeypatch.delenv("ACQD_METERING")


def test_without_a_compiler_numpy_meters_and_the_reason_is_given(tmp_path):
    call = [sys.executable, "-c", "from acqd.metering.kernel import why_not; print(why_not())"]
    bare = {"PATH": str(tmp_path), "HOME": str(tmp_path)}
    assert b"no C compiler" in subprocess.run(call, env=bare, capture_output=True, check=True).stdout
    asked = bare | {"ACQD_METERING": "numpy"}
    assert b"ACQD_METERING=numpy" in subprocess.run(call, env=asked, capture_output=True, check=True).stdout
    assert why_not() is None


SANITISED = """
import numpy as np
from acqd.metering import Meter, SampleBlock, StreamFormat
from tests.mains import make_mains
for f in (45.3, 50.0):
    mains = make_mains(f, seconds=0.44, noise=0.001)
    for bits in (16, 32, 64):
        form = StreamFormat(20_000.0, mains.scale, bits=bits)
        for mode in ("synchronous", "fixed"):
            meter = Meter(form, mode=mode)
            assert meter._kernel is not None
            for k in range(0, len(mains.codes), 800):
                meter.feed(SampleBlock(mains.codes[k : k + 800].astype(form.dtype), k, 0))
print("clean")
"""


def test_no_read_outside_the_samples_and_no_undefined_behaviour(tmp_path):
    compiler = system_compiler()
    runtime = subprocess.run([compiler, "-print-file-name=libasan.so"], capture_output=True, text=True).stdout.strip()
    if not Path(runtime).is_absolute():
        pytest.skip("no address sanitizer")
    built, (source,) = tmp_path / "window.so", window(6, best_instruction_set()).sources
    flags = ["-O0", "-g", "-std=gnu11", "-fPIC", "-shared", "-w", "-fsanitize=address,undefined", "-DCHANNELS=6"]
    subprocess.run([compiler, *flags, "-fno-sanitize-recover=all", source, "-o", built, "-lm"], check=True)
    environment = os.environ | {"ACQD_METERING": str(built), "LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"}
    done = subprocess.run(
        [sys.executable, "-c", SANITISED], env=environment, capture_output=True, text=True, cwd=source.parents[3]
    )
    assert done.stdout == "clean\n", done.stderr[-3_000:]


@settings(max_examples=12, deadline=None)
@given(
    sizes=st.lists(st.sampled_from([800, 800, 800, 400, 1_600, 790]), min_size=10, max_size=14),
    named=st.lists(st.sampled_from(["", "", "late", "simulated", "clock_step"]), min_size=14, max_size=14),
    gap=st.sampled_from([0, 100, 800]),
)
def test_blocks_of_one_window_are_metered_like_any_other(sizes, named, gap):
    """What completes just one window of a running stream goes a shorter way, which numpy does not know."""
    mains = make_mains(50.03, seconds=1.2, noise=0.001)
    form, position, batches = StreamFormat(20_000.0, mains.scale), 0, {True: [], False: []}
    meters = {compiled: Meter(form, compiled=compiled) for compiled in batches}
    for k, (size, flag) in enumerate(zip(sizes, named, strict=False)):
        position += gap if k == 5 else 0
        codes = mains.codes[position : position + size]
        block = SampleBlock(codes, position, position * 50_000 + 7 * k, gap if k == 5 else 0, frozenset({flag} - {""}))
        position += size
        for compiled, meter in meters.items():
            batches[compiled].append(meter.feed(block))
    for one, other in zip(batches[True], batches[False], strict=True):
        assert (one is None) == (other is None)
        if one is not None:
            assert_equal(one, other, 3e-5)  # windows of a longer block begin with the same trial in numpy
            assert one.seq.tolist() == other.seq.tolist() and one.utc_ns.tolist() == other.utc_ns.tolist()
    np.testing.assert_allclose(*(meter.energy.reading() for meter in meters.values()), rtol=1e-12)
    assert meters[True].finish() == meters[False].finish()


def test_codes_of_other_channels_than_the_stream_never_reach_c():
    """C is given an address only: it would read beyond the samples."""
    mains = make_mains(50.03, seconds=0.4)
    meter = Meter(StreamFormat(20_000.0, mains.scale))
    for k in range(0, 8_000, 800):
        meter.feed(SampleBlock(mains.codes[k : k + 800], k, 0))
    two_phases = np.ascontiguousarray(mains.codes[:, :4])
    assert meter._kernel.meter_live(two_phases, 4_000, 4_800, meter.energy) is None
    assert meter._kernel.meter_live(mains.codes, 4_000, 4_800, meter.energy) is not None


def test_a_library_of_another_acqd_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "window.c").write_text("int acqd_windows(void) { return 0; }")
    built = tmp_path / "window.so"
    subprocess.run([system_compiler(), "-shared", "-fPIC", tmp_path / "window.c", "-o", built], check=True)
    monkeypatch.setenv("ACQD_METERING", str(built))
    assert "built from the window.c of another acqd" in why_not.__wrapped__(6)
