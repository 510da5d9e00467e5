"""MATLAB files that would end the process in SciPy are refused before."""

from __future__ import annotations

import io
import struct

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.sources import ChannelMap, load_waveform
from acqd.sources.arrays.mat_elements import check_elements

scipy_io = pytest.importorskip("scipy.io")
T = np.arange(400) / 10_000


def saved(compressed=False):
    file = io.BytesIO()
    data = {"t": T, "u1": 325 * np.cos(314 * T), "i1": 5 * np.cos(314 * T)}
    scipy_io.savemat(file, data | {"note": "text", "s": {"unit": "V"}}, do_compression=compressed)
    return file.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_files_of_scipy_pass(compressed, tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(saved(compressed))
    check_elements(path)
    cell = np.array([np.arange(3.0), "text", np.array([])], dtype=object)
    sparse = __import__("scipy.sparse", fromlist=["eye"]).eye(4).tocsc()
    scipy_io.savemat(path, {"cell": cell, "sparse": sparse, "z": np.ones(3) * 1j, "empty": np.zeros((0, 3))})
    check_elements(path)


@pytest.mark.parametrize("code", [0, 8, 10, 14, 15, 19, 20, 700, 65_535])
def test_a_type_that_there_is_not_is_refused(code, tmp_path):
    content, path = saved(), tmp_path / "a.mat"
    tag = struct.pack("<II", 9, 8 * len(T))  # the numbers of t, u1 and i1
    for at in (content.index(tag), content.rindex(tag)):
        path.write_bytes(content[:at] + struct.pack("<II", code, 8 * len(T)) + content[at + 8 :])
        with pytest.raises(InputError, match="MATLAB"):
            load_waveform(path, ChannelMap())


def test_whatever_is_cut_or_changed_is_refused_or_read(tmp_path):
    random, path = np.random.default_rng(3), tmp_path / "a.mat"
    for compressed in (False, True):
        content = saved(compressed)
        for k in range(40):
            broken = bytearray(content[: random.integers(1, len(content))] if k % 4 == 0 else content)
            for at in random.integers(0, min(len(broken), 600 if k % 2 else len(broken)), 8 * (k % 4 > 0)):
                broken[at] = random.integers(256)
            path.write_bytes(broken)
            try:
                load_waveform(path, ChannelMap())
            except InputError:
                continue
