"""Files of any kind: truncated, empty, unknown, unreadable."""

from __future__ import annotations

import gzip
import os

import pytest

from acqd.errors import InputError, UserError
from acqd.sources import ChannelMap, load_waveform


def test_other_broken_files(tmp_path, waveforms):
    whole = (waveforms / "microwave_1ph_20k" / "replay_20k_el3783.npz").read_bytes()
    cases = {
        "truncated.npz": (whole[:100_000], "truncated"), "empty.npz": (b"", "empty"), "noise.npz": (b"x" * 99, "NPZ"),
        "noise.wav": (b"x" * 99, "--u-scale"), "a.xyz": (b"x", "unknown kind"), "noise.cfg": (b"x" * 9, "dat"),
        "latin.csv": (b"time,u1,i1\n\xff\xfe", "not text"),
    }  # fmt: skip
    for name, (content, complaint) in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=complaint):
            load_waveform(tmp_path / name)
    with pytest.raises(InputError, match="no readable WAV"):
        load_waveform(tmp_path / "noise.wav", ChannelMap(u_scale=1.0, i_scale=1.0))
    with pytest.raises(InputError, match="no such file"):
        load_waveform(tmp_path / "missing.npz")
    with pytest.raises(UserError, match="not like u1="):
        ChannelMap.parse("u1:a")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable_file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x")
    path.chmod(0)
    with pytest.raises(InputError, match="permissions"):
        load_waveform(path)


def test_compressed_files_are_named(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(gzip.compress(b"time,u1,i1\n0,1,2\n"))
    with pytest.raises(InputError, match=r"is compressed \(gzip\); unpack it first"):
        load_waveform(path)
    with pytest.raises(InputError, match=r"is compressed \(gz\); unpack it first"):
        load_waveform(path.rename(tmp_path / "a.csv.gz"))
