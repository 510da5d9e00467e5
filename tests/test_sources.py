"""Every kind of waveform file, good and broken."""

from __future__ import annotations

import os

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import InputError, UserError
from acqd.metering import Meter, SampleBlock
from acqd.sources import ChannelMap, ReplaySource, SimulatedSource, SimulationSettings, load_waveform
from acqd.sources.simulated import Sag
from acqd.sources.spec import make_source, replay_spec, simulated_spec

from .conftest import make_mains

GOOD = {
    "u_code": np.ones((1, 4_000), np.int16), "i_code": np.ones((1, 4_000), np.int16),
    "u_V_per_digit": 0.0225, "i_A_per_digit": 0.000281, "fs": 20_000,
}  # fmt: skip


def write_csv(path, rows=4_000, rate=10_000.0, t0=0.0, header="time,u1,i1", delimiter=","):
    mains = make_mains(50.0, seconds=rows / rate, rate=rate, phases=1)
    t = t0 + np.arange(rows) / rate
    table = np.column_stack((t, mains.codes * np.array(mains.scale)))
    lines = [delimiter.join(f"{value:.9f}" for value in row) for row in table]
    path.write_text("\n".join([header.replace(",", delimiter), *lines]) + "\n")
    return mains


def test_csv_gives_the_values_it_holds(tmp_path):
    mains = write_csv(tmp_path / "a.csv")
    waveform = load_waveform(tmp_path / "a.csv")
    assert waveform.form.rate == pytest.approx(10_000, rel=1e-6) and waveform.start_utc_ns is None
    batch = Meter(waveform.form).feed(SampleBlock(waveform.codes, 0, 0))
    assert batch.Vrms[0, -1] == pytest.approx(mains.Vrms, rel=2e-4)
    assert batch.P[0, -1] == pytest.approx(mains.P, rel=4e-4)


def test_csv_with_semicolons_decimal_commas_and_unix_time(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path, t0=1_700_000_000.0, delimiter=";")
    path.write_text(path.read_text().replace(".", ","))
    waveform = load_waveform(path)
    assert waveform.start_utc_ns == 1_700_000_000_000_000_000
    assert waveform.form.rate == pytest.approx(10_000, rel=1e-4)


def test_csv_columns_by_map_and_scale(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path, header="t,Ch A,Ch B")
    waveform = load_waveform(path, ChannelMap({"u1": "Ch A", "i1": "Ch B"}, u_scale=100.0, i_scale=10.0))
    plain = load_waveform(path, ChannelMap({"u1": "1", "i1": "2"}))
    assert waveform.form.scale[0] == pytest.approx(100 * plain.form.scale[0])
    assert waveform.form.scale[1] == pytest.approx(10 * plain.form.scale[1])


@pytest.mark.parametrize("kind", ["wav", "flac"])
def test_sound_files_are_exact(tmp_path, kind):
    mains = make_mains(50.0, seconds=0.5, rate=44_100.0, phases=2)
    path = tmp_path / f"a.{kind}"
    soundfile.write(path, mains.codes, 44_100, subtype="PCM_16")
    waveform = load_waveform(path, ChannelMap(u_scale=mains.scale[0] * 32768, i_scale=mains.scale[1] * 32768))
    np.testing.assert_array_equal(waveform.codes, mains.codes)
    assert waveform.form.scale == pytest.approx(mains.scale)


def test_comtrade_without_phase_letters(waveforms):
    waveform = load_waveform(waveforms / "ion7650_3ph_60hz" / "source" / "keating_1999.CFG")
    assert waveform.form.phases == 3 and waveform.form.f_nominal == 60.0
    assert waveform.form.rate == pytest.approx(30_707.24, abs=0.01)


BROKEN_NPZ = {
    "no u_code": ({"u_code": None}, "lacks u_code"),
    "NaN": ({"u_code": np.full((1, 4_000), np.nan)}, "NaN"),
    "text": ({"u_code": np.full((1, 4_000), "x")}, "expected int16"),
    "one channel": ({"i_code": None}, "lacks i_code"),
    "unequal": ({"i_code": np.ones((1, 3_999), np.int16)}, "differ"),
    "four phases": ({k: np.ones((4, 100), np.int16) for k in ("u_code", "i_code")}, "1 to 3"),
    "no samples": ({k: np.ones((1, 0), np.int16) for k in ("u_code", "i_code")}, "no samples"),
    "no int16": ({"u_code": np.full((1, 4_000), 40_000)}, "int16"),
    "too slow": ({"fs": 1_000}, "2 kHz"),
    "no rate": ({"fs": float("nan")}, "fs is"),
    "absurd scale": ({"u_V_per_digit": 1e9}, "full scale"),
    "zero scale": ({"i_A_per_digit": 0.0}, "full scale"),
    "negative scale": ({"i_A_per_digit": -1.0}, "full scale"),
}


@pytest.mark.parametrize("case", BROKEN_NPZ)
def test_broken_npz_is_named(tmp_path, case):
    changes, complaint = BROKEN_NPZ[case]
    content = {key: value for key, value in (GOOD | changes).items() if value is not None}
    np.savez(tmp_path / "a.npz", **content)
    with pytest.raises(InputError, match=complaint) as caught:
        load_waveform(tmp_path / "a.npz")
    assert str(tmp_path / "a.npz") in str(caught.value) and "\n" not in str(caught.value)


BROKEN_CSV = {
    "time,u1,i1\n0,1,2\n0.0001,x,2\n": "row 3, column 2: 'x' is not a number",
    "time,u1,i1\n0,1,2\n0.0001,1\n": "row 3 has 2 columns, expected 3",
    "time,u1,i1\n0,1,2\n0.0001,nan,2\n": "row 3, column 2",
    "time,u1,i1\n": "no samples",
    "time,u1\n0,1\n0.1,2\n": "u1 but no i1",
    "time,a,b\n0,1,2\n": "no voltage and current",
    "0,1,2\n0.0001,1,2\n": "row 1 has no names",
    "u1,i1\n1,2\n": "--rate",
    "time,u1,i1\n0,1,2\n0,1,2\n": "does not advance",
    "time,u1,i1\n0,1,2\n0.0001,1,2\n0.0005,1,2\n0.0006,1,1\n": "equidistant",
    "time,u1,i1\n0,1,2\n0.01,1,2\n0.02,1,2\n": "2 kHz",
}


@pytest.mark.parametrize("text", BROKEN_CSV)
def test_broken_csv_is_named_with_its_row(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=BROKEN_CSV[text]):
        load_waveform(path)


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


def test_a_truncated_sound_file_is_noticed(tmp_path):
    path = tmp_path / "a.wav"
    soundfile.write(path, make_mains(50.0, seconds=0.5, phases=1).codes, 20_000, subtype="PCM_16")
    path.write_bytes(path.read_bytes()[:30_000])
    with pytest.raises(InputError, match="truncated"):
        load_waveform(path, ChannelMap(u_scale=400.0, i_scale=10.0))


def test_a_hole_in_a_csv_is_named_at_its_row(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:2_001] + lines[2_501:]))
    with pytest.raises(InputError, match="row 2002"):
        load_waveform(path)


def test_truncated_comtrade_is_noticed(tmp_path, waveforms):
    source = waveforms / "generator_3ph" / "source"
    (tmp_path / "test3.cfg").write_bytes((source / "test3.cfg").read_bytes())
    (tmp_path / "test3.dat").write_bytes((source / "test3.dat").read_bytes()[:900_000])
    with pytest.raises(InputError, match="truncated"):
        load_waveform(tmp_path / "test3.cfg")


@settings(max_examples=20, deadline=None)
@given(reads=st.lists(st.integers(0, 3_000), min_size=1, max_size=10), loops=st.integers(1, 4))
def test_replay_plays_every_sample_once_per_loop(reads, loops):
    codes = np.arange(5_000, dtype=np.int16).reshape(-1, 2)
    mains = make_mains(50.0, seconds=0.2, phases=1)
    mains.codes = codes
    from acqd.metering import StreamFormat
    from acqd.sources.waveform import Waveform

    source = ReplaySource(Waveform("w", codes, StreamFormat(20_000.0, mains.scale), 7), loops)
    source.open(99, index=40)
    parts, index = [], 40
    for limit in [*reads, *[10_000] * 5]:
        block = source.read(limit)
        if block is None:
            break
        assert block.index == index and block.utc_ns == 7 + (index - 40) * 50_000
        index += len(block.codes)
        parts.append(block.codes)
    np.testing.assert_array_equal(np.concatenate(parts), np.tile(codes, (loops, 1)))


@settings(max_examples=15, deadline=None)
@given(reads=st.lists(st.integers(1, 2_500), min_size=1, max_size=8))
def test_simulated_samples_do_not_depend_on_how_they_are_read(reads):
    one, many = SimulatedSource(), SimulatedSource()
    one.open(0)
    many.open(0)
    parts = [many.read(limit).codes for limit in reads]
    np.testing.assert_array_equal(np.concatenate(parts), one.read(sum(reads)).codes)


def test_simulation_keeps_what_its_settings_promise(tmp_path):
    profile = tmp_path / "p.csv"
    profile.write_text("t,P1\n0,100\n10,100\n")
    sag = Sag(at=1.0, duration=0.5, depth=0.4)
    settings_ = SimulationSettings(
        frequency=49.5, frequency_wander=0.0, voltage=225.0, harmonics={}, current_harmonics={}, dc=0.01,
        load_profile=profile, sags=(sag,), noise=0.0,
    )  # fmt: skip
    source = make_source(simulated_spec(settings_))
    source.open(0)
    block = source.read(60_000)
    assert block.flags == {"simulated"}
    batch = Meter(source.form).feed(block)
    expected = 225.0 * np.sqrt(1 + 2 * 0.01**2 / 2)
    assert batch.Vrms[0, 10] == pytest.approx(expected, rel=3e-4)
    assert batch.P[:, 10] == pytest.approx(100.0, rel=1e-3)
    assert batch.f[10] == pytest.approx(49.5, abs=0.002)
    assert batch.Vrms[0, 30] == pytest.approx(0.6 * 225.0, rel=1e-3)
    assert batch.Vrms[0, 50] == pytest.approx(expected, rel=3e-4)


def test_bad_load_profile_is_named(tmp_path):
    path = tmp_path / "p.csv"
    for text, complaint in (("a,b\n", "header"), ("t,P1\n0,x\n", "row 2"), ("t,P1\n0,1\n0,1\n", "rising")):
        path.write_text(text)
        with pytest.raises(InputError, match=complaint):
            SimulatedSource(SimulationSettings(load_profile=path))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable_file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x")
    path.chmod(0)
    with pytest.raises(InputError, match="permissions"):
        load_waveform(path)


def test_a_replay_spec_survives_the_way_to_another_process(tmp_path):
    import json

    write_csv(tmp_path / "a.csv")
    spec = json.loads(json.dumps(replay_spec(tmp_path / "a.csv", ChannelMap(), 2)))
    source = make_source(spec)
    source.open(0)
    assert len(source.read(100_000).codes) == 8_000 and source.read(1) is None
