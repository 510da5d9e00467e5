"""Quantities of whole intervals: closed forms, and recordings of real mains."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.quality.meter import QualityMeter
from acqd.sources import load_waveform
from tests.mains import make_mains
from tests.metering.quality.waves import metered, of_kind, three_phases

RATE = 20_000.0
t = np.arange(9_000) / RATE


@settings(max_examples=20)
@given(st.floats(45, 57), st.floats(-np.pi, np.pi), st.floats(0.1, 20), st.floats(-5, 5))
def test_fundamental_powers_have_their_signs_and_dc_stays_out(f, lag, amperes, dc):
    x = three_phases(2 * np.pi * f * t + 1.0, amperes=amperes, lag=lag)
    x[:, 1] += dc + 0.3 * amperes * np.cos(3 * 2 * np.pi * f * t)
    [one, *_] = of_kind(metered(x, RATE))
    phase, power = one.phase, 230 * amperes
    assert phase["P1"] == pytest.approx(power * np.cos(lag), abs=1e-3 * power)
    assert phase["Q1"] == pytest.approx(power * np.sin(lag), abs=1e-3 * power)
    assert phase["V1"] == pytest.approx(230, rel=1e-5) and phase["I1"] == pytest.approx(amperes, rel=1e-4)
    assert phase["V1_angle"] == pytest.approx([0, -120, 120], abs=0.01)
    assert phase["I_dc"][0] == pytest.approx(dc, abs=1e-3 * amperes) and phase["I_dc"][1] == pytest.approx(0, abs=1e-3)
    assert phase["V_crest"] == pytest.approx(np.sqrt(2), rel=1e-3)
    assert phase["I_thds"] == pytest.approx([30 / np.sqrt(2), 0, 0], abs=0.02)


def test_distortion_line_voltages_neutral_and_unbalance():
    x = three_phases(2 * np.pi * 50.1 * t, amperes=5.0)
    fifth = 0.05 * 230 * np.sqrt(2) * np.cos(5 * 2 * np.pi * 50.1 * t)
    x[:, 0::2] += fifth[:, None]  # zero sequence: not between lines
    x[:, 5] = 0
    [one, *_] = of_kind(metered(x, RATE))
    assert one.phase["V_thds"] == pytest.approx(5.0, abs=0.01)
    assert one.phase["V_h"][:, 4] == pytest.approx(11.5, abs=0.01)
    system = one.system
    assert [system[name] for name in ("V_12", "V_23", "V_31")] == pytest.approx([230 * np.sqrt(3)] * 3, rel=1e-5)
    assert system["I_n_derived"] == pytest.approx(5.0, rel=1e-4)
    assert system["V_u2"] == pytest.approx(0, abs=1e-3) and system["V_u0"] == pytest.approx(0, abs=1e-3)
    assert system["I_u2"] == pytest.approx(50, rel=1e-3) and system["I_u0"] == pytest.approx(50, rel=1e-3)
    assert system["rotation"] == 1 and system["Se"] > system["S"]


def test_two_phases_have_one_line_voltage_and_one_phase_has_no_system():
    x = three_phases(2 * np.pi * 50 * t)
    assert of_kind(metered(x[:, :2], RATE))[0].system == {}
    two = of_kind(metered(x[:, :4], RATE))[0].system
    assert two["V_12"] == pytest.approx(230 * np.sqrt(3)) and "V_u2" not in two and two["P"] > 0


def test_without_voltage_and_current_nothing_is_made_up():
    [one, *_] = of_kind(metered(np.zeros((9_000, 6)), RATE))
    assert np.isnan(one.f) and one.phase["Vrms"] == pytest.approx(0)
    for name in ("V_crest", "I_crest", "V_thds", "I_thds", "V1_angle"):
        assert np.isnan(one.phase[name]).all()
    assert np.isnan([one.system[name] for name in ("V_u2", "V_u0", "rotation")]).all()


def values_of(folder):
    waveform = load_waveform(folder / "replay_20k_el3783.npz")
    return waveform, of_kind(QualityMeter(waveform.form).feed(SampleBlock(waveform.codes, 0, 0)))


@pytest.mark.parametrize("name", ["generator_3ph", "merging_unit_3ph", "microwave_1ph_20k"])
def test_recordings_agree_with_their_independent_reference(waveforms, name):
    """f against zero crossings of the filtered voltage, RMS against exact sums over two cycles."""
    _, values = values_of(waveforms / name)
    table = np.genfromtxt(waveforms / name / "ref_40ms.csv", delimiter=",", names=True)
    table = table[(table["phase"] == 1) & np.isfinite(table["f_sync"])]
    middle = table["t_start_s"] + 0.02
    pairs = []
    for one in values:
        at = middle - one.utc_ns * 1e-9
        inside = table[(at > 0) & (at < one.duration)]
        if len(inside) >= 4:
            pairs.append((one.f - inside["f_sync"].mean(), one.phase["Vrms"][0] / inside["U_sync"].mean() - 1))
    errors = np.array(pairs)
    assert len(errors) >= 15
    assert np.median(np.abs(errors[:, 0])) < 0.002 and np.median(np.abs(errors[:, 1])) < 2e-4


def test_harmonics_of_a_recording_are_those_of_a_least_squares_fit(waveforms):
    """An independent DFT: no resampling, no groups; DC and 50 harmonics of f fitted to the samples of the interval."""
    waveform, values = values_of(waveforms / "merging_unit_3ph")
    one, rate = values[5], waveform.form.rate
    first = round(one.utc_ns * 1e-9 * rate)
    samples = slice(first, first + round(one.duration * rate))
    time = np.arange(samples.stop - samples.start) / rate
    turns = 2 * np.pi * one.f * np.outer(time, np.arange(1, 51))
    design = np.hstack((np.ones((len(time), 1)), np.cos(turns), np.sin(turns)))
    for phase in range(3):
        u = waveform.codes[samples, 2 * phase] * waveform.form.scale[2 * phase]
        fit = np.linalg.lstsq(design, u, rcond=None)[0]
        rms = np.hypot(fit[1:51], fit[51:]) / np.sqrt(2)
        np.testing.assert_allclose(one.phase["V_h"][phase, 1:32], rms[1:32], atol=1e-3 * rms[0])
        assert one.phase["V1"][phase] == pytest.approx(rms[0], rel=1e-4)


def test_the_terminal_of_a_60_hz_recording_needs_no_setting(waveforms):
    waveform, values = values_of(waveforms / "ion7650_3ph_60hz")
    assert waveform.form.f_nominal == 60 and values == []  # 67 ms hold no interval


@pytest.mark.parametrize(("f", "nominal"), [(60.0, 50.0), (50.0, 60.0), (16.667, 50.0), (400.0, 50.0)])
def test_mains_of_another_frequency_than_configured_have_no_spectrum_and_say_so(f, nominal):
    mains = make_mains(f, seconds=1.0, noise=0.001)
    meter = QualityMeter(StreamFormat(RATE, mains.scale, f_nominal=nominal))
    values = of_kind(meter.feed(SampleBlock(mains.codes, 0, 0)))
    assert values
    for one in values:
        assert {"off_nominal", "transient"} <= one.flags and np.isnan(one.f)
        known = {name for name, value in one.phase.items() if not np.isnan(value).all()}
        assert known == {"Vrms", "Irms", "P", "S", "V_crest", "I_crest", "V_dc", "I_dc"}
        assert np.isnan([one.system[name] for name in ("V_u2", "V_u0", "V_pos", "P1", "rotation")]).all()
    assert all(one.phase["Vrms"] == pytest.approx(230, rel=0.05) for one in values)


def test_an_interruption_and_a_dip_are_of_the_nominal_frequency():
    x = three_phases(2 * np.pi * 50 * np.arange(40_000) / RATE)
    x[15_000:25_000, 0::2] *= 0.02
    x[32_000:, 0::2] *= 0.6
    assert not any("off_nominal" in one.flags for one in metered(x, RATE))
