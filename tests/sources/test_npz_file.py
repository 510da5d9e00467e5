"""NPZ files."""

from __future__ import annotations

import re

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.sources import load_waveform

GOOD = {
    "u_code": np.ones((1, 4_000), np.int16), "i_code": np.ones((1, 4_000), np.int16),
    "u_V_per_digit": 0.0225, "i_A_per_digit": 0.000281, "fs": 20_000,
}  # fmt: skip


BROKEN_NPZ = {
    "no u_code": ({"u_code": None}, "lacks u_code"),
    "NaN": ({"u_code": np.full((1, 4_000), np.nan)}, "NaN"),
    "text": ({"u_code": np.full((1, 4_000), "x")}, "expected int16"),
    "one channel": ({"i_code": None}, "lacks i_code"),
    "unequal": ({"i_code": np.ones((1, 3_999), np.int16)}, "differ"),
    "four phases": ({k: np.ones((4, 100), np.int16) for k in ("u_code", "i_code")}, "1 to 3"),
    "no samples": ({k: np.ones((1, 0), np.int16) for k in ("u_code", "i_code")}, "no samples"),
    "no int16": ({"u_code": np.full((1, 4_000), 40_000)}, "int16"),
    "too slow": ({"fs": 100}, "200 Hz"),
    "no rate": ({"fs": float("nan")}, "fs is"),
    "absurd scale": ({"u_V_per_digit": 1e9}, "full scale"),
    "zero scale": ({"i_A_per_digit": 0.0}, "full scale"),
    "negative scale": ({"i_A_per_digit": -1.0}, "full scale"),
    "a start in seconds": ({"start_utc_ns": 1_700_000_000}, "1.7 s after 1970; expected nanoseconds"),
    "a start in ms": ({"start_utc_ns": 1_700_000_000_000}, "expected nanoseconds"),
}


@pytest.mark.parametrize("case", BROKEN_NPZ)
def test_broken_npz_is_named(tmp_path, case):
    changes, complaint = BROKEN_NPZ[case]
    content = {key: value for key, value in (GOOD | changes).items() if value is not None}
    np.savez(tmp_path / "a.npz", **content)
    with pytest.raises(InputError, match=complaint) as caught:
        load_waveform(tmp_path / "a.npz")
    assert str(tmp_path / "a.npz") in str(caught.value) and "\n" not in str(caught.value)


UNFIT = {
    "objects": ({"u1": np.array([{}], dtype=object)}, "holds Python objects (dtype object), which are not read"),
    "complex": ({"u1": np.ones(400, complex), "i1": np.ones(400)}, "; u1 holds complex numbers, expected real ones"),
    "lengths": ({"u1": np.ones(400), "i1": np.ones(90)}, "other lengths or rates than u1 have i1: left out"),
}


@pytest.mark.parametrize("case", UNFIT)
def test_a_refusal_says_why_an_array_is_missing(tmp_path, case):
    arrays, complaint = UNFIT[case]
    np.savez(tmp_path / "a.npz", fs=20_000, **arrays)
    with pytest.raises(InputError, match=re.escape(complaint)):
        load_waveform(tmp_path / "a.npz")


def test_arrays_of_other_names_are_channels_by_their_names(tmp_path):
    wave = np.sin(2 * np.pi * np.arange(800) / 80)
    np.savez(tmp_path / "a.npz", voltage_mV=325e3 * wave, current_mA=7e3 * wave, dt=2.5e-4)
    form = load_waveform(tmp_path / "a.npz").form
    assert form.rate == pytest.approx(4_000) and form.scale == pytest.approx((1e-3, 1e-3))


def test_volts_and_amperes_may_stand_in_columns(tmp_path):
    u, i = np.random.default_rng(1).normal(size=(2, 4_000, 3))
    np.savez(tmp_path / "a.npz", u_V=u, i_A=i, fs=20_000)
    np.savez(tmp_path / "b.npz", u_V=u.T, i_A=i.T, fs=20_000)
    first, second = (load_waveform(tmp_path / name).codes for name in ("a.npz", "b.npz"))
    np.testing.assert_array_equal(first, second)
