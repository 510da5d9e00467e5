"""The virtual mains against acqd's meter."""

import numpy as np
import pytest

from acqd.lab.instruments.mains import Mains, MainsSettings, Metered
from acqd.metering import Meter, SampleBlock, WindowBatch


def metered(settings, power, fault=None, window=0.04, chunk=3000):
    mains = Mains(settings, np.random.default_rng(5))
    meter = Meter(mains.form, window=window)
    batches, index = [], 0
    for first in range(0, len(power), chunk):
        part = power[first : first + chunk]
        ones = np.ones(len(part))
        codes = mains.waveform(part, fault and Metered(fault.gain[0] * ones, fault.limit[0] * ones))
        batches.append(meter.feed(SampleBlock(codes, index, index * 50_000)))
        index += len(codes)
    return WindowBatch.join([batch for batch in batches if batch is not None])


@pytest.mark.parametrize(
    "settings",
    [
        MainsSettings(),
        MainsSettings(shape="rectifier"),
        MainsSettings(frequency=60.0, voltage=120.0),
        MainsSettings(harmonics={}, current_harmonics={}, frequency_wander=0, voltage_wander=0, filter_current=0),
        MainsSettings(voltage_wander=5.0, frequency_wander=0.1, filter_current=0.4),
    ],
)
@pytest.mark.parametrize("power", [40.0, 155.0, 600.0])
def test_the_meter_reads_the_power_that_was_demanded(settings, power):
    window = 0.05 if settings.frequency > 55 else 0.04
    batch = metered(settings, np.full(20_000, power), window=window)
    np.testing.assert_allclose(batch.P[0], power, rtol=1e-3)
    assert abs(batch.P[0].mean() / power - 1) < 2e-4
    assert abs(batch.f.mean() - settings.frequency) < 0.5
    assert abs(batch.Vrms[0].mean() / settings.voltage - 1) < 0.1


def test_changing_power_is_metered_without_losing_energy():
    t = np.arange(30_000) / 1000
    power = 180 + 60 * np.sin(2 * np.pi * 1.3 * t) + 40 * (t % 2 > 1)
    batch = metered(MainsSettings(), power)
    assert batch.W[0][-1] * 3.6e6 == pytest.approx(np.trapezoid(power[: len(batch) * 40 + 1], dx=1e-3), rel=1e-4)


def test_waveforms_do_not_depend_on_how_they_are_asked_for():
    power = 180 + 50 * np.sin(np.arange(9000) / 300)
    whole, parts = (Mains(MainsSettings(noise_A=0, noise_V=0), np.random.default_rng(1)) for _ in range(2))
    pieces = np.concatenate([parts.waveform(power[a:b]) for a, b in ((0, 1), (1, 4000), (4000, 4001), (4001, 9000))])
    difference = whole.waveform(power).astype(int) - pieces
    assert np.abs(difference).max() <= 1


def test_a_rectifier_draws_pulses_and_a_pfc_a_sine():
    pulses = metered(MainsSettings(shape="rectifier", filter_current=0), np.full(5000, 200.0))
    sine = metered(MainsSettings(filter_current=0), np.full(5000, 200.0))
    power_factor = [float((batch.P / batch.S).mean()) for batch in (pulses, sine)]
    assert power_factor[0] < 0.85 < 0.99 < power_factor[1]


def test_inrush_drives_the_converter_over_its_range_once():
    batch = metered(MainsSettings(inrush=20.0), np.full(5000, 155.0))
    flagged = [k for k, flags in enumerate(batch.flags[0]) if "overrange" in flags]
    assert flagged and max(flagged) < 5


def test_a_faulty_current_sensor_shows_in_the_power():
    power = np.full(5000, 200.0)
    gain = metered(MainsSettings(), power, Metered(np.array([1.03]), np.array([np.inf])))
    assert gain.P[0].mean() == pytest.approx(206.0, rel=1e-3)
    clipped = metered(MainsSettings(), power, Metered(np.array([1.0]), np.array([1.0])))
    assert clipped.P[0].mean() < 190
