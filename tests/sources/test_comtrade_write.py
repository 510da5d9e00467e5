"""COMTRADE files as other people's readers and ours see them, compared with the NPZ of the same samples."""

from __future__ import annotations

import comtrade
import numpy as np
import pytest

from acqd.errors import UserError
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.sources import Waveform, load_waveform
from acqd.sources.comtrade.write import time_factor, write_comtrade
from acqd.sources.npz_write import npz_bytes

NS = 1_700_000_000_123_456_789


def waveform(bits=16, phases=3, samples=4_000, rate=20_000.0, scales=None, start=NS, seed=0) -> Waveform:
    random = np.random.default_rng(seed)
    shape = (samples, 2 * phases)
    if bits == 16:
        codes = random.integers(-32768, 32768, shape).astype(np.int16)
        codes[0], codes[1] = -32768, 32767
    elif bits == 32:
        codes = random.integers(-(2**26), 2**26, shape).astype(np.int32)
    else:
        codes = random.normal(0, 100, shape)
    scale = scales or ((0.0225, 0.000281) * phases if bits < 64 else (1.0, 1.0) * phases)
    return Waveform("x", codes, StreamFormat(rate, scale, 50.0, bits), start)


def physical(one: Waveform) -> np.ndarray:
    return one.codes * np.array(one.form.scale)


def saved(tmp_path, one: Waveform, name: str):
    path = tmp_path / name
    if path.suffix == ".npz":
        path.write_bytes(npz_bytes(one))
    else:
        write_comtrade(path, one)
    return path


@pytest.mark.parametrize("bits", [16, 32, 64])
@pytest.mark.parametrize("name", ["x.cff", "x.cfg"])
def test_our_reader_gives_back_what_the_npz_gives_back(tmp_path, bits, name):
    one = waveform(bits)
    from_npz, from_comtrade = (load_waveform(saved(tmp_path, one, each)) for each in ("x.npz", name))
    tolerance = np.abs(physical(one)).max(axis=0) * (2.0**-32 if bits == 64 else 1e-15)
    assert (np.abs(physical(from_comtrade) - physical(from_npz)) <= tolerance).all()
    assert physical(from_npz) == pytest.approx(physical(one), rel=1e-15)
    assert from_comtrade.start_utc_ns == from_npz.start_utc_ns == NS
    assert from_comtrade.form.rate == from_npz.form.rate and from_comtrade.form.f_nominal == 50


@pytest.mark.parametrize("bits", [16, 64])
@pytest.mark.parametrize("name", ["x.cff", "x.cfg"])
def test_the_reader_from_pypi_gives_the_samples_of_the_npz(tmp_path, bits, name):
    one = waveform(bits)
    read = comtrade.Comtrade(use_numpy_arrays=True, ignore_warnings=True)
    path = saved(tmp_path, one, name)
    if name.endswith("cff"):
        read.load(str(path))
    else:
        read.load(str(path), str(path.with_suffix(".dat")))
    values = np.column_stack(read.analog)
    expected = physical(load_waveform(saved(tmp_path, one, "x.npz")))
    peak = np.abs(expected).max(axis=0)
    assert (np.abs(values - expected) <= peak * 1e-6).all()  # it keeps float32
    assert read.analog_channel_ids == ["U1", "I1", "U2", "I2", "U3", "I3"]
    assert read.analog_phases == ["L1", "L1", "L2", "L2", "L3", "L3"]
    assert read.cfg.frequency == 50 and read.cfg.rev_year == "2013" and read.total_samples == len(one.codes)
    assert np.diff(read.time) == pytest.approx(5e-5, abs=2e-6)


def test_long_recordings_have_times_in_coarser_units():
    assert time_factor(20_000 * 4_290, 20_000.0) == 1
    assert time_factor(20_000 * 4_300, 20_000.0) == 10


def test_without_a_start_there_is_none_and_phases_may_have_scales_of_their_own(tmp_path):
    one = waveform(16, 2, scales=(0.01, 0.001, 0.02, 0.002), start=None)
    for name in ("x.npz", "x.cff"):
        back = load_waveform(saved(tmp_path, one, name))
        assert back.start_utc_ns is None
        assert physical(back) == pytest.approx(physical(one), rel=1e-14)


def test_energy_and_voltage_are_those_of_the_npz(tmp_path, waveforms):
    recorded = load_waveform(waveforms / "generator_3ph" / "replay_20k_el3783.npz")
    results = []
    for name in ("x.npz", "x.cff"):
        back = load_waveform(saved(tmp_path, recorded, name))
        results.append(Meter(back.form).feed(SampleBlock(back.codes, 0, 0)))
    assert results[1].imported[:, -1] == pytest.approx(results[0].imported[:, -1], rel=1e-9)
    assert results[1].Vrms == pytest.approx(results[0].Vrms, rel=1e-9)


def test_another_ending_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"ends in \.cff"):
        write_comtrade(tmp_path / "x.csv", waveform())
