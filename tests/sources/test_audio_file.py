"""Sound files."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile

from acqd.errors import InputError
from acqd.sources import ChannelMap, load_waveform
from tests.mains import make_mains


@pytest.mark.parametrize("kind", ["wav", "flac"])
def test_sound_files_are_exact(tmp_path, kind):
    mains = make_mains(50.0, seconds=0.5, rate=44_100.0, phases=2)
    path = tmp_path / f"a.{kind}"
    soundfile.write(path, mains.codes, 44_100, subtype="PCM_16")
    waveform = load_waveform(path, ChannelMap(u_scale=mains.scale[0] * 32768, i_scale=mains.scale[1] * 32768))
    np.testing.assert_array_equal(waveform.codes, mains.codes)
    assert waveform.form.scale == pytest.approx(mains.scale)


def test_a_truncated_sound_file_is_noticed(tmp_path):
    path = tmp_path / "a.wav"
    soundfile.write(path, make_mains(50.0, seconds=0.5, phases=1).codes, 20_000, subtype="PCM_16")
    path.write_bytes(path.read_bytes()[:30_000])
    with pytest.raises(InputError, match="truncated"):
        load_waveform(path, ChannelMap(u_scale=400.0, i_scale=10.0))


@pytest.mark.parametrize("length", [0, 0x7FFF_FFFF, 0xFFFF_FFFF, 0x7FFF_F000])
def test_a_stream_without_a_length_is_read_to_its_end(tmp_path, length):
    path = tmp_path / "a.wav"
    mains = make_mains(50.0, seconds=0.5, phases=1)
    soundfile.write(path, mains.codes, 20_000, subtype="PCM_16")
    content = bytearray(path.read_bytes())
    at = content.index(b"data") + 4
    content[at : at + 4] = length.to_bytes(4, "little")
    path.write_bytes(bytes(content) + b"x")  # the pipe has ended within a sample
    waveform = load_waveform(path, ChannelMap(u_scale=400.0, i_scale=10.0))
    np.testing.assert_array_equal(waveform.codes, mains.codes)
    assert "written through a pipe" in waveform.notes[0]
    path.write_bytes(bytes(content).replace(b"fmt ", b"fmx "))
    with pytest.raises(InputError, match="no readable WAV"):
        load_waveform(path, ChannelMap(u_scale=400.0, i_scale=10.0))


def test_voltages_before_currents_are_not_taken_for_pairs(tmp_path):
    turns = 2 * np.pi * (50 * np.arange(8_000)[:, None] / 8_000 - np.arange(3) / 3)
    u, i = 0.8 * np.sin(turns), 0.5 * np.sin(turns - 0.5)
    scales = {"u_scale": 400.0, "i_scale": 10.0}
    soundfile.write(tmp_path / "a.wav", np.hstack((u, i)), 8_000)
    with pytest.raises(InputError, match="--map u1=0,i1=3,u2=1,i2=4,u3=2,i3=5"):
        load_waveform(tmp_path / "a.wav", ChannelMap(**scales))
    soundfile.write(tmp_path / "b.wav", np.stack((u, i), axis=2).reshape(-1, 6), 8_000)
    assert load_waveform(tmp_path / "b.wav", ChannelMap(**scales)).form.phases == 3


@pytest.mark.parametrize("u2", [0.79, 1e-4])
def test_pairs_of_one_phase_with_a_reversed_clamp_stay_pairs(tmp_path, u2):
    wave = np.sin(2 * np.pi * 50 * np.arange(8_000) / 8_000)
    soundfile.write(tmp_path / "a.wav", np.outer(wave, [0.8, -0.4, u2, 0.4]), 8_000, subtype="PCM_16")
    assert load_waveform(tmp_path / "a.wav", ChannelMap(u_scale=400.0, i_scale=10.0)).form.phases == 2


@pytest.mark.parametrize(("largest", "asked"), [(325.0, True), (1.3, False)])
def test_floats_far_beyond_full_scale_are_asked_about(tmp_path, largest, asked):
    path, t = tmp_path / "a.wav", np.arange(4_000) / 10_000
    soundfile.write(path, largest * np.cos(2 * np.pi * 50 * np.stack((t, t), 1)), 10_000, subtype="FLOAT")
    notes = load_waveform(path, ChannelMap(u_scale=400.0, i_scale=10.0)).notes
    assert any("times full scale: are they V and A?" in note for note in notes) == asked
    in_volts = load_waveform(path, ChannelMap(u_scale=1.0, i_scale=1.0))
    assert not any("times full scale" in note for note in in_volts.notes)
