"""Binary files of oscilloscopes: what they say of units, and the files of one trigger together."""

from __future__ import annotations

import struct
import tracemalloc

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.metering import Meter, SampleBlock
from acqd.sources import ChannelMap, load_waveform
from acqd.sources.load import load_recording
from tests.sources.scopes.writers import RATE, I, U, isf, lecroy, tektronix_wfm

pytestmark = pytest.mark.xdist_group("files")  # one worker imports the libraries

PAIRS = {
    "lecroy": ("C{}--shot--00000.trc", lecroy, {}),
    "lecroy, bytes": ("C{}shot00000.trc", lecroy, {"wide": False, "prefix": b""}),
    "lecroy, big endian": ("C{}shot00000.trc", lecroy, {"order": ">"}),
    "isf": ("tek0001CH{}.isf", isf, {}),
    "isf, short": ("tek0001ch{}.isf", isf, {"short": True, "kind": "RP", "order": "LSB"}),
    "isf, bytes": ("T0001CH{}.isf", isf, {"wide": 1}),
    "wfm": ("tek0001CH{}.wfm", tektronix_wfm, {}),
}


@pytest.mark.parametrize("kind", PAIRS)
def test_two_files_of_one_trigger_are_metered_together(tmp_path, kind):
    name, write, options = PAIRS[kind]
    for channel, values, unit in ((1, U, "V"), (3, I, "A")):
        (tmp_path / name.format(channel)).write_bytes(write(values, unit, channel=channel, **options))
    waveform = load_waveform(tmp_path / name.format(3))
    assert waveform.form.rate == pytest.approx(RATE, rel=1e-6)
    batch = Meter(waveform.form).feed(SampleBlock(waveform.codes, 0, 0))
    found = [float(column[0, -1]) for column in (batch.Vrms, batch.Irms, batch.P)]
    coarse = 4e-3 if "bytes" in kind else 1e-4
    assert found == pytest.approx([230, 5, 230 * 5 * np.cos(0.5)], rel=coarse)
    assert any("read together" in note for note in waveform.notes)
    if kind == "lecroy":
        assert waveform.start_utc_ns == 1_687_342_512_250_000_000 - 100_000_000


def test_a_file_without_its_current_says_which_file_is_missing(tmp_path):
    (tmp_path / "C1shot.trc").write_bytes(lecroy(U, "V"))
    with pytest.raises(InputError, match=r"with that of the current beside it"):
        load_waveform(tmp_path / "C1shot.trc")


def test_traces_of_another_length_are_left_out(tmp_path):
    (tmp_path / "C1shot.trc").write_bytes(lecroy(U, "V"))
    (tmp_path / "C2shot.trc").write_bytes(lecroy(I, "A", channel=2))
    (tmp_path / "C3shot.trc").write_bytes(lecroy(I[:900], "A", channel=3))
    notes = load_waveform(tmp_path / "C1shot.trc").notes
    assert any("C3shot.trc has another length" in note for note in notes)


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("a.trc", lecroy(U, "V", segments=3), "3 segments of sequence mode"),
        ("a.trc", lecroy(U, "V")[:-1], "truncated"),
        ("a.isf", isf(U, "V")[:-1], "truncated"),
        ("a.isf", isf(U, "V", form="ENV"), "envelope"),
        ("a.isf", isf(U, "V").replace(b"XINCR", b"XIXCR"), "lacks XINCR"),
        ("a.wfm", tektronix_wfm(U, "V")[:700], "truncated: its header has 838 bytes"),
        ("a.bin", b"nothing at all", "save as .csv"),
    ],
)
def test_what_cannot_be_metered_is_refused_in_one_line(tmp_path, name, content, complaint):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=complaint):
        load_waveform(tmp_path / name)


def test_the_file_of_another_channel_may_be_damaged(tmp_path):
    (tmp_path / "tek0001CH1.wfm").write_bytes(tektronix_wfm(U, "V"))
    (tmp_path / "tek0001CH2.wfm").write_bytes(tektronix_wfm(I, "A", channel=2)[1:])
    with pytest.raises(InputError, match=r"CH2\.wfm: does not begin as a Tektronix waveform"):
        load_waveform(tmp_path / "tek0001CH1.wfm")


def test_the_readers_agree_with_an_independent_one(tmp_path):
    from RigolWFM.wfm import Wfm

    for name, content in (("a.trc", lecroy(U, "V", wide=False)), ("a.isf", isf(U, "V", wide=1))):
        (tmp_path / name).write_bytes(content)
        theirs = Wfm.from_file(str(tmp_path / name)).channels[0]
        ours = load_recording(tmp_path / name, ChannelMap())
        assert np.abs(ours.column(0).physical() - theirs.volts).max() < 1e-4
        assert ours.rate == pytest.approx(1 / theirs.seconds_per_point, rel=1e-6)


@pytest.mark.parametrize("wide", [1, 2])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("version", [1, 2, 3])
def test_every_version_of_tektronix_wfm_is_that_of_an_independent_reader(tmp_path, version, order, wide):
    from RigolWFM.wfm import Wfm

    path = tmp_path / "a.wfm"
    path.write_bytes(tektronix_wfm(U, "V", version=version, order=order, wide=wide, before=7))
    theirs, ours = Wfm.from_file(str(path)).channels[0], load_recording(path, ChannelMap())
    assert ours.channels[0].unit == "V" and ours.samples == len(U)
    assert np.abs(ours.column(0).physical() - theirs.volts).max() < 1e-4
    assert np.abs(ours.column(0).physical() - U).max() < (0.02 if wide == 2 else 2.0)
    assert ours.rate == pytest.approx(RATE)


@pytest.mark.parametrize("points", [0, -5, 10**9])
def test_a_trace_of_lecroy_without_samples_is_refused(tmp_path, points):
    content = bytearray(lecroy(U, "V", prefix=b""))
    content[116:120] = struct.pack("<i", points)
    (tmp_path / "a.trc").write_bytes(content)
    with pytest.raises(InputError, match=rf"announces {points} samples, has {len(U)}"):
        load_waveform(tmp_path / "a.trc")


@pytest.mark.parametrize(
    ("place", "value", "complaint"),
    [
        (72, b"\3\0\0\0", "holds 4 frames of FastFrame"), (78, b"\1\0\0\0", "FastFrame"),
        (122, b"\6\0\0\0", "digital lines"), (240, b"\3\0\0\0", "format 3 in 2 bytes"),
        (168, b"\0" * 6 + b"\xf8\x7f", "has scale nan"), (826, b"\xff" * 4, "truncated or damaged"),
        (488, b"\0" * 8, "its samples are 0 s apart"), (-1, b"tekmeta!IQ_span", "pairs of I and Q"),
    ],
)  # fmt: skip
def test_what_is_no_trace_of_tektronix_is_refused(tmp_path, place, value, complaint):
    content = bytearray(tektronix_wfm(U, "V"))
    if place < 0:
        content += value
    else:
        content[place : place + len(value)] = value
    (tmp_path / "a.wfm").write_bytes(content)
    with pytest.raises(InputError, match=complaint):
        load_waveform(tmp_path / "a.wfm")


@pytest.mark.parametrize(("name", "write"), [PAIRS[kind][:2] for kind in ("lecroy", "isf", "wfm")])
def test_recordings_of_8_bits_are_in_memory_once_as_codes(tmp_path, name, write):
    rising = np.linspace(0.5, 1.0, 500 * len(U))  # flat tops of a few codes would look clipped
    u, i = np.tile(U, 500) * rising, np.tile(I, 500) * rising
    for channel, (values, unit) in enumerate(((u, "V"), (i, "A")), start=1):
        (tmp_path / name.format(channel)).write_bytes(write(values, unit, channel=channel, wide=1))
    load_waveform(tmp_path / name.format(1))  # imports
    tracemalloc.start()
    waveform = load_waveform(tmp_path / name.format(1))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert waveform.codes.dtype == np.int16
    size = sum(path.stat().st_size for path in tmp_path.iterdir())
    assert peak < 3.5 * size  # with passes of a fixed size, which matter the less the longer a file is


def test_sums_of_fast_codes_are_codes(tmp_path):
    step, faster = struct.pack("<d", 1 / RATE), struct.pack("<d", 1 / 3e6)
    for channel, (values, unit) in enumerate(((U, "V"), (I, "A")), start=1):
        written = tektronix_wfm(np.repeat(values, 300), unit, wide=1).replace(step, faster)
        (tmp_path / f"aCH{channel}.wfm").write_bytes(written)
    waveform = load_waveform(tmp_path / "aCH1.wfm")
    assert waveform.codes.dtype == np.int16 and any("means of 3 samples" in note for note in waveform.notes)
    assert waveform.form.rate == pytest.approx(1e6)
    one_code = np.abs(U).max() / 120
    assert np.abs(waveform.codes[:, 0] * waveform.form.scale[0] - np.repeat(U, 100)).max() <= 0.51 * one_code


def test_a_recording_faster_than_the_meter_is_averaged_with_a_word(tmp_path):
    t = np.arange(200_000) / 5e6
    u, i = 325 * np.cos(2 * np.pi * 50 * t), 7 * np.cos(2 * np.pi * 50 * t - 0.5)
    np.savez(tmp_path / "a.npz", u_V=u[None], i_A=i[None], fs=5e6, start_utc_ns=1_700_000_000_000_000_000)
    waveform = load_waveform(tmp_path / "a.npz")
    assert waveform.form.rate == 1e6 and waveform.start_utc_ns == 1_700_000_000_000_000_400
    assert any("means of 5 samples" in note for note in waveform.notes)
    assert np.abs(waveform.codes[:, 0] - u[2::5]).max() < 1e-6 * 325
    assert np.abs(waveform.codes[:, 1] - i[2::5]).max() < 1e-6 * 7


def test_a_channel_of_codes_is_that_of_the_library_without_its_arrays():
    from types import SimpleNamespace

    from RigolWFM.channel import Channel

    from acqd.sources.scopes.lean import LeanChannel

    codes = np.random.default_rng(0).integers(0, 256, 1000).astype(np.uint8)
    one = {
        "enabled_and_selected": True, "raw": codes, "y_scale": 0.04, "y_offset": -1.3, "time_offset": 2e-3,
        "points": 1000, "seconds_per_point": 1e-5, "times": None, "volts": None,
    }  # fmt: skip
    for options in ({}, {"midpoint": 125.0}, {"sample_aligned": True, "memory_depth_points": 1200}):
        library, lean = SimpleNamespace(**one), SimpleNamespace(**one)
        Channel.calc_times_and_volts(library, **options)
        LeanChannel.calc_times_and_volts(lean, **options)
        assert lean.codes is codes
        assert lean.codes * lean.factor + lean.zero == pytest.approx(library.volts, abs=1e-12)
        assert lean.origin_s == pytest.approx(library.times[0], abs=1e-9)
