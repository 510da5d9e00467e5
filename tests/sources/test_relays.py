"""Recordings of relays: low rates, headers of any edition, dates in any order; flags through the command."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import soundfile

from acqd.errors import InputError
from acqd.metering import Meter, SampleBlock
from acqd.sources import ChannelMap, load_waveform
from tests.commands import acqd_here
from tests.mains import make_mains
from tests.sources.comtrade import Recording


def power(waveform):
    batch = Meter(waveform.form).feed(SampleBlock(waveform.codes, 0, 0))
    return batch.Vrms[:, 2:], batch.P[:, 2:]


@pytest.mark.parametrize("f", [49.9, 50.0, 50.2])
@pytest.mark.parametrize(("rate", "share"), [(400.0, 2e-3), (600.0, 1e-3), (960.0, 1.5e-3), (1_200.0, 1e-3)])
def test_a_few_samples_a_cycle_are_enough(tmp_path, rate, share, f):
    t = np.arange(int(2 * rate)) / rate
    mains = make_mains(f, seconds=2.0, rate=rate)
    for phase in range(3):  # without the third harmonic, which the lowest rate cannot hold
        angle = 2 * np.pi * f * t - 2 * np.pi * phase / 3
        mains.codes[:, 2 * phase] = np.rint(230 * np.sqrt(2) * np.cos(angle) / mains.scale[0])
        mains.codes[:, 2 * phase + 1] = np.rint(3 * np.sqrt(2) * np.cos(angle - 0.5) / mains.scale[1])
    waveform = load_waveform(Recording(mains).write(tmp_path))
    V, P = power(waveform)
    np.testing.assert_allclose(V, 230, rtol=share)
    np.testing.assert_allclose(P, 230 * 3 * np.cos(0.5), rtol=share)
    assert "harmonics up to number" in " ".join(waveform.notes)


@pytest.mark.parametrize("edition", [0, 1991, 1997, 1999, 2000, 2001, 2013, 2017])
@pytest.mark.parametrize("stamp", ["25/05/2017,08:13:16.587", "05/25/2017,08:13:16.587"])
def test_editions_and_dates(tmp_path, edition, stamp):
    tail = ("1", "0,0", "0,0") if edition >= 2013 else ("1",)
    waveform = load_waveform(
        Recording(make_mains(50.0, seconds=0.2), edition=edition, stamp=stamp, tail=tail).write(tmp_path)
    )
    assert waveform.start_utc_ns == 1_495_699_996_587_000_000
    assert (f"edition {edition}" in " ".join(waveform.notes)) == (edition in (0, 1997, 2000, 2017))


def test_no_rates_a_comma_and_markers_without_colons(tmp_path):
    recording = Recording(make_mains(50.0, seconds=0.2))
    recording = replace(recording, segments=((0.0, len(recording.codes)),))
    header = recording.header().replace(b"\r\n50\r\n1\r\n", b"\r\n50,\r\n0\r\n")
    assert b"50,\r\n0\r\n" in header
    data = recording.data()
    cff = b"--- file type CFG ---\r\n" + header + b"--- file type DAT BINARY %d ---\r\n" % len(data) + data
    (tmp_path / "a.cff").write_bytes(cff)
    assert load_waveform(tmp_path / "a.cff").form.rate == pytest.approx(20_000)


@pytest.mark.parametrize(
    ("old", "new"),
    [(b"\r\n50\r\n", b"\r\n50 Hz\r\n"), (b"\r\n50\r\n", b"\r\n50;\r\n"), (b"\r\n20000,", b"\r\n20000Hz,"),
     (b"Station", b"\r\n\r\nStation"), (b"\r\n", b"\r\n\r\n"), (b"25/06/2007,19", b"2007-06-25,19"),
     (b"25/06/2007,19", b"2007/06/25 19"), (b"57.789757", b"57,789757")],
)  # fmt: skip
def test_what_recorders_write_otherwise_is_read(tmp_path, old, new):
    recording = Recording(make_mains(50.0, seconds=0.2))
    path = recording.write(tmp_path)
    assert old in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old, new))
    waveform = load_waveform(path)
    assert waveform.start_utc_ns == 1_182_798_837_789_757_000 and waveform.form.f_nominal == 50.0


@pytest.mark.parametrize(("rate", "right"), [(12_800.0, True), (14_400.0, True), (12_820.0, False), (12_300.0, False)])
def test_a_rate_that_the_times_contradict_is_refused(tmp_path, rate, right):
    """12,800 and 14,400 samples/s have steps of 78.125 and 69.44 us, which are printed as whole ones."""
    mains = make_mains(50.0, seconds=0.3, rate=rate if right else 12_800.0)
    path = replace(Recording(mains), segments=((rate, len(mains.codes)),)).write(tmp_path)
    if right:
        assert load_waveform(path).form.rate == rate
    else:
        with pytest.raises(InputError, match=r"its header says 12[83]\d\d+ samples/s.*--rate"):
            load_waveform(path)
        assert load_waveform(path, ChannelMap(rate=12_800.0)).form.rate == 12_800.0


@pytest.mark.parametrize("subtype", ["PCM_16", "PCM_24"])
def test_clipped_windows_are_flagged_in_rows_and_named(tmp_path, subtype):
    t = np.arange(20_000) / 20_000
    u = 0.8 * np.cos(2 * np.pi * 50 * t)
    i = np.clip(1.2 * np.cos(2 * np.pi * 50 * t - 0.4) * (1 + (t > 0.5)) / 1.7, -1, 0.9999)
    soundfile.write(tmp_path / "a.wav", np.column_stack([u, i]), 20_000, subtype=subtype)
    words = ["replay", "a.wav", "--u-scale", "400", "--i-scale", "10", "--out", "r.jsonl"]
    done = acqd_here(*words, cwd=tmp_path)
    assert done.returncode == 0 and "flagged clipped" in done.stderr
    rows = [json.loads(line) for line in (tmp_path / "r.jsonl").read_text().splitlines()]
    flagged = ["clipped" in row["flags"] for row in rows]
    assert flagged[:12] == [False] * 12 and all(flagged[14:-1])


def test_inspect_names_a_reversed_transformer_with_the_correction(tmp_path):
    mains = make_mains(50.0, seconds=1.0)
    mains.codes[:, 3] *= -1
    done = acqd_here("replay", "--inspect", Recording(mains).write(tmp_path), "--json")
    [wiring] = json.loads(done.stdout)["wiring"]
    assert wiring == "i2 is reversed; [source] correction = { i_gain = [1.0, -1.0, 1.0] }"


@pytest.mark.parametrize(("rate", "hint"), [(2_000.0, False), (2_020.0, True)])
def test_a_rate_that_the_mains_of_a_minute_contradict_is_a_hint(tmp_path, rate, hint):
    mains = make_mains(50.02, seconds=61.0, rate=2_000.0, phases=1)
    codes = {"u_code": mains.codes[:, 0], "i_code": mains.codes[:, 1], "fs": rate}
    np.savez(tmp_path / "a.npz", **codes, u_V_per_digit=mains.scale[0], i_A_per_digit=mains.scale[1])
    done = acqd_here("replay", tmp_path / "a.npz")
    assert done.returncode == 0 and ("is the sampling rate right" in done.stderr) == hint


def test_headers_that_recorders_of_others_write(tmp_path):
    recording = Recording(make_mains(50.0, seconds=0.2), edition=2013, kind="FLOAT32", tail=("1", "0,0", "0,0"))
    header, data = recording.header(), recording.data()
    limits = header.replace(b"-32767,32767", b"-3.40282347E+38,3.40282347E+38").replace(b",0D", b"")
    (tmp_path / "a.Cfg").write_bytes(limits)
    (tmp_path / "a.Dat").write_bytes(data)
    assert load_waveform(tmp_path / "a.Cfg").form.rate == 20_000
    text = Recording(make_mains(50.0, seconds=0.2), kind="ASCII")
    (tmp_path / "b.cfg").write_bytes(text.header().replace(b"\r\n", b"\r"))
    (tmp_path / "b.dat").write_bytes(text.data().replace(b"\r\n", b"\r"))
    assert len(load_waveform(tmp_path / "b.cfg").codes) == len(text.codes)


@pytest.mark.parametrize(("share", "read"), [(1.004, True), (1.5, False)])
def test_rates_that_follow_the_mains_are_metered_at_their_mean(tmp_path, share, read):
    recording = Recording(make_mains(50.0, seconds=0.2), segments=((20_000.0, 1_000), (20_000.0 * share, 4_000)))
    path = recording.write(tmp_path)
    if not read:
        with pytest.raises(InputError, match="changes its sampling rate"):
            load_waveform(path)
        return
    waveform = load_waveform(path)
    assert waveform.form.rate == pytest.approx(4_000 / (1_000 / 20_000 + 3_000 / (20_000 * share)))
    assert "follows the mains" in " ".join(waveform.notes)
