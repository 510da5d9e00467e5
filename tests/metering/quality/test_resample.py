"""Resampling in C against numpy."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.c_builds import resample
from acqd.compiling import system_compiler
from acqd.instruction_sets import best_instruction_set
from acqd.metering.kernel.compiled import resample_library
from acqd.metering.quality.resample import MARGIN, resampled, resampled_by_numpy

X = np.random.default_rng(4).normal(0, 300, (6, 700))
compiled = pytest.mark.skipif(system_compiler() is None, reason="no C compiler")


@compiled
@settings(max_examples=40, deadline=None)
@given(start=st.floats(MARGIN, 60.0), step=st.floats(0.2, 1.4), count=st.integers(1, 400), channels=st.integers(1, 6))
def test_c_and_numpy_agree_to_rounding(start, step, count, channels):
    x = X[:channels]
    assert resample_library() is not None
    np.testing.assert_allclose(
        resampled(x, start, step, count), resampled_by_numpy(x, start, step, count), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize(("start", "count"), [(10.0, 100), (MARGIN, 700)])
def test_instants_without_samples_around_them_are_refused(start, count):
    with pytest.raises(IndexError, match="samples beyond"):
        resampled(X, start, 1.0, count)


def test_without_c_numpy_resamples():
    code = "import numpy as np; from acqd.metering.kernel.compiled import resample_library as r; print(r())"
    environment = os.environ | {"ACQD_METERING": "numpy"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "None\n"


SANITISED = """
import ctypes, numpy as np, sys
from acqd.metering.quality.resample import _rows, _STEPS, TAPS
call = ctypes.CDLL(sys.argv[1]).acqd_resample
number, pointer, integer = ctypes.c_double, ctypes.c_void_p, ctypes.c_int64
call.argtypes = [pointer, integer, integer, number, number, integer, pointer, integer, pointer]
for samples in (64, 100):
    x, count = np.ones((6, samples)), samples - TAPS + 1
    out = np.empty((6, count))
    for first in (TAPS // 2 - 1.0, TAPS // 2 - 1 + 1 - 1e-12):
        call(x.ctypes.data, 6, samples, first, 1.0, count, _rows().ctypes.data, _STEPS, out.ctypes.data)
    np.testing.assert_allclose(out, 1)
print("clean")
"""


@compiled
def test_no_read_outside_the_samples_and_no_undefined_behaviour(tmp_path):
    compiler = system_compiler()
    runtime = subprocess.run([compiler, "-print-file-name=libasan.so"], capture_output=True, text=True).stdout.strip()
    if not Path(runtime).is_absolute():
        pytest.skip("no address sanitizer")
    built, build = tmp_path / "resample.so", resample(best_instruction_set())
    flags = ["-O1", "-g", "-std=gnu11", "-fPIC", "-shared", "-w", "-fsanitize=address,undefined"]
    subprocess.run([compiler, *flags, "-fno-sanitize-recover=all", build.sources[0], "-o", built, "-lm"], check=True)
    environment = os.environ | {"LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"}
    command = [sys.executable, "-c", SANITISED, str(built)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=build.sources[0].parents[3])
    assert done.stdout == "clean\n", done.stderr[-3_000:]
