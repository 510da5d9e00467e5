"""The meter on real recordings against their independent references."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.metering import Meter, SampleBlock
from acqd.sources import load_waveform

STEADY = ["microwave_1ph_20k", "fridge_1ph_20k", "generator_3ph", "merging_unit_3ph"]


def metered(waveforms, name, mode):
    waveform = load_waveform(waveforms / name / "replay_20k_el3783.npz")
    batch = Meter(waveform.form, mode=mode).feed(SampleBlock(waveform.codes, 0, 0))
    table = np.genfromtxt(waveforms / name / "ref_40ms.csv", delimiter=",", names=True)
    reference = {}
    for column in table.dtype.names:
        grid = np.full(batch.P.shape, np.nan)
        grid[table["phase"].astype(int) - 1, table["k"].astype(int)] = table[column]
        reference[column] = grid
    return batch, reference


@pytest.mark.parametrize("name", [*STEADY, "ion7650_3ph_60hz"])
def test_fixed_mode_and_energy_agree_with_the_reference(waveforms, name):
    batch, reference = metered(waveforms, name, "fixed")
    for quantity, column in ((batch.Vrms, "U_fix"), (batch.Irms, "I_fix"), (batch.P, "P_fix"), (batch.S, "S_fix")):
        np.testing.assert_allclose(quantity, reference[column], rtol=1e-6)
    np.testing.assert_allclose(batch.W * 1000, reference["E_Wh"], rtol=1e-6)


@pytest.mark.parametrize("name", STEADY)
def test_synchronous_mode_agrees_with_the_reference(waveforms, name):
    batch, reference = metered(waveforms, name, "synchronous")
    assert np.nanmedian(np.abs(batch.Vrms / reference["U_sync"] - 1)) < 0.0001
    assert np.nanmedian(np.abs(batch.f - reference["f_sync"])) < 0.002


@pytest.mark.parametrize(
    ("name", "largest_f", "largest_V"),
    [
        ("microwave_1ph_20k", 0.0016, 1.0e-5),
        ("fridge_1ph_20k", 0.0011, 0.8e-5),
        ("generator_3ph", 0.0006, 0.8e-5),
        ("merging_unit_3ph", 0.00015, 0.4e-5),
    ],
)
def test_f_and_voltage_of_two_cycles_on_real_mains(waveforms, name, largest_f, largest_V):
    """The reference has samples before and after its cycles, and f wanders by some mHz from window to window."""
    batch, reference = metered(waveforms, name, "synchronous")
    assert np.nanmedian(np.abs(batch.f - reference["f_sync"])) < largest_f
    assert np.nanmedian(np.abs(batch.Vrms / reference["U_sync"] - 1)) < largest_V
    doubted = np.mean(["unsettled" in flags for flags in batch.flags[0]])
    assert doubted < 0.1, "f wanders, but not with the voltage"


def test_60_hz_recording_of_67_ms(waveforms):
    batch, reference = metered(waveforms, "ion7650_3ph_60hz", "synchronous")
    assert np.abs(batch.f - reference["f_sync"]).max() < 0.005
    assert np.abs(batch.Vrms / reference["U_sync"] - 1).max() < 0.002  # the reference is centred elsewhere


def test_comtrade_source_at_its_own_rate_agrees_with_the_20_khz_stream(waveforms):
    native = load_waveform(waveforms / "generator_3ph" / "source" / "test3.cfg")
    assert native.form.rate == 5760.0 and native.start_utc_ns == 1182798837789757000
    batch = Meter(native.form).feed(SampleBlock(native.codes, 0, 0))
    other, _ = metered(waveforms, "generator_3ph", "synchronous")
    assert np.median(np.abs(batch.Vrms / other.Vrms - 1)) < 0.0002
    assert np.median(np.abs(batch.P / other.P - 1)) < 0.001
