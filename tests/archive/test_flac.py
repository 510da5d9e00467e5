"""FLAC read in C: the codes that libsndfile reads, and nothing outside of damaged data."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.archive import coding
from acqd.archive.flac import read_flac
from acqd.c_builds import flac
from acqd.compiling import system_compiler

compiled = pytest.mark.skipif(system_compiler() is None, reason="no C compiler")


def waves(kind: str, samples: int, channels: int, seed: int) -> np.ndarray:
    """Codes of every kind of subframe: constant, verbatim, fixed and linear prediction, with unused bits."""
    random, t = np.random.default_rng(seed), np.arange(samples)[:, None]
    values = {
        "constant": np.full((samples, channels), seed - 50),
        "noise": random.integers(-(2**15), 2**15, (samples, channels)),
        "mains": 15_000 * np.sin(t * 0.0157 + np.arange(channels)) + random.normal(0, seed, (samples, channels)),
        "walk": np.cumsum(random.integers(-3, 4, (samples, channels)), axis=0),
        "coarse": random.integers(-9, 9, (samples, channels)) * 64,
    }[kind]
    return np.clip(np.rint(values), -(2**15), 2**15 - 1)


@compiled
@settings(max_examples=60, deadline=None)
@given(
    kind=st.sampled_from(["constant", "noise", "mains", "walk", "coarse"]),
    samples=st.sampled_from([1, 5, 191, 800, 4096, 5000, 8000]), channels=st.integers(1, 8),
    factor=st.sampled_from([0, 1, 7, 256]), seed=st.integers(0, 99),
)  # fmt: skip
def test_codes_are_those_of_the_library(kind, samples, channels, factor, seed):
    codes = waves(kind, samples, channels, seed)
    codes = codes.astype(np.int32) * factor if factor else codes.astype(np.int16)
    name, data = coding.encode(codes)
    found = read_flac(data, samples, channels, 24 if factor else 16)
    assert found is not None and found.dtype == codes.dtype
    assert np.array_equal(found, codes) and np.array_equal(found, coding._unflac_by_library(name, data))
    assert read_flac(data, samples + 1, channels, 24 if factor else 16) is None, "another number of samples"
    if samples > 1:
        assert read_flac(data, samples - 1, channels, 24 if factor else 16) is None


DAMAGED = """
import sys
from pathlib import Path
import numpy as np
from acqd.archive import coding, flac
from tests.archive.test_flac import waves
library = flac.load_flac(Path(sys.argv[1]))
flac.flac_library = lambda: library
random, read = np.random.default_rng(3), 0
for kind in ("constant", "noise", "mains", "walk", "coarse"):
    for bits, dtype in ((16, np.int16), (24, np.int32)):
        _, data = coding.encode(waves(kind, 700, 3, 8).astype(dtype))
        assert flac.read_flac(data, 700, 3, bits) is not None
        for trial in range(60):
            broken = bytearray(data)
            for _ in range(int(random.integers(1, 5))):
                broken[int(random.integers(42, len(broken)))] = int(random.integers(256))
            cut = int(random.integers(1, len(broken))) if trial % 3 == 0 else len(broken)
            read += flac.read_flac(bytes(broken[:cut]), 700, 3, bits) is not None
print("clean", read > 0)
"""


@compiled
def test_damaged_data_are_read_within_their_bounds_and_without_undefined_behaviour(tmp_path):
    compiler, build, built = system_compiler(), flac(), tmp_path / "flac.so"
    runtime = subprocess.run([compiler, "-print-file-name=libasan.so"], capture_output=True, text=True).stdout.strip()
    if not Path(runtime).is_absolute():
        pytest.skip("no address sanitizer")
    flags = ["-O1", "-g", "-std=gnu11", "-fPIC", "-shared", "-w", "-fsanitize=address,undefined"]
    subprocess.run([compiler, *flags, "-fno-sanitize-recover=all", *build.sources, "-o", built], check=True)
    environment = os.environ | {"LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"}
    command = [sys.executable, "-c", DAMAGED, str(built)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=build.sources[0].parents[2])
    assert done.stdout == "clean True\n", done.stderr[-3_000:]
