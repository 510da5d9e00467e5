"""FLAC read in C against libsndfile."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acqd.archive import coding
from acqd.archive.coding import decode, encode
from acqd.c_builds import flac
from acqd.compiling import system_compiler
from acqd.instruction_sets import best_instruction_set

pytestmark = pytest.mark.skipif(system_compiler() is None, reason="no C compiler")
RANDOM = np.random.default_rng(5)
WALK = np.cumsum(RANDOM.integers(-9, 10, (9_000, 6)), axis=0)
STREAMS = {
    "walk": WALK.astype(np.int16),
    "one phase": WALK[:, :2].astype(np.int16),
    "one sample": WALK[:1].astype(np.int16),
    "constant": np.full((5_000, 4), -7, np.int16),
    "white": RANDOM.integers(-32_768, 32_768, (5_000, 4)).astype(np.int16),
    "end stops": RANDOM.choice([-32_768, 32_767], (5_000, 4)).astype(np.int16),
    "24 bits": (WALK * 900).astype(np.int32),
    "24 bits, the last ones 0": (WALK * 64).astype(np.int32),
    "24 bits, white": RANDOM.integers(-(2**23), 2**23, (5_000, 2)).astype(np.int32),
}


@pytest.mark.parametrize("name", STREAMS)
def test_c_reads_what_libsndfile_writes(name, monkeypatch):
    codes = STREAMS[name]
    how, data = encode(codes)
    assert np.array_equal(coding._unflac_by_libsndfile(how, data), codes)
    monkeypatch.setattr(coding, "_unflac_by_libsndfile", lambda *_: pytest.fail("C did not read it"))
    assert np.array_equal(decode(how, data, codes.dtype, *codes.shape), codes)


def test_without_c_libsndfile_reads_it(monkeypatch):
    how, data = encode(STREAMS["walk"])
    monkeypatch.setattr(coding, "_library", lambda: None)
    assert np.array_equal(decode(how, data, np.dtype(np.int16), 9_000, 6), STREAMS["walk"])


def test_other_numbers_of_samples_or_channels_are_not_made_up():
    how, data = encode(STREAMS["walk"])
    for samples, channels in ((8_999, 6), (9_001, 6), (9_000, 4), (10**12, 6)):
        with pytest.raises(ValueError, match="expected"):
            decode(how, data, np.dtype(np.int16), samples, channels)


def test_a_frame_that_does_not_state_its_width_is_left_to_libsndfile(monkeypatch):
    """The header of the stream may say another one: 16 bits would be read as 24."""
    how, data = encode(STREAMS["walk"][:192])
    frame = data.index(b"\xff\xf8", 4 + 4 + 34)
    unstated = bytearray(data)
    unstated[frame + 3] &= 0b11110001
    monkeypatch.setattr(coding, "_unflac_by_libsndfile", lambda *_: "libsndfile")
    assert coding._unflac(how, bytes(unstated), 192, 6) == "libsndfile"
    assert np.array_equal(coding._unflac(how, data, 192, 6), STREAMS["walk"][:192])


SANITISED = """
import ctypes, random, sys
call = ctypes.CDLL(sys.argv[1]).acqd_unflac
call.argtypes = [ctypes.c_char_p, *[ctypes.c_int64] * 4, ctypes.c_void_p]
for path, samples, channels, width in (("walk", 2_000, 6, 16), ("wide", 2_000, 2, 24)):
    data = open(path, "rb").read()
    out = ctypes.create_string_buffer(samples * channels * (width + 8) // 8)
    assert call(data, len(data), channels, samples, width, out)
    for length in range(0, len(data), 97):
        assert not call(data[:length], length, channels, samples, width, out)
    for seed in range(300):
        harmed, dice = bytearray(data), random.Random(seed)
        for _ in range(dice.choice((1, 3, 40))):
            harmed[dice.randrange(len(data) if seed % 2 else 90)] = dice.choice((0, 255, dice.randrange(256)))
        call(bytes(harmed), len(harmed), channels, samples, width, out)
print("clean")
"""


def test_harmed_streams_end_without_undefined_behaviour(tmp_path):
    compiler = system_compiler()
    runtime = subprocess.run([compiler, "-print-file-name=libasan.so"], capture_output=True, text=True).stdout.strip()
    if not Path(runtime).is_absolute():
        pytest.skip("no address sanitizer")
    (tmp_path / "walk").write_bytes(encode(STREAMS["walk"][:2_000])[1])
    (tmp_path / "wide").write_bytes(encode(STREAMS["24 bits, white"][:2_000])[1])
    built = tmp_path / "flac.so"
    flags = ["-O1", "-g", "-std=gnu11", "-fPIC", "-shared", "-fsanitize=address,undefined"]
    subprocess.run(
        [compiler, *flags, "-fno-sanitize-recover=all", *flac(best_instruction_set()).sources, "-o", built], check=True
    )
    environment = os.environ | {"LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"}
    command = [sys.executable, "-S", "-c", SANITISED, str(built)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout == "clean\n", done.stderr[-3_000:]
