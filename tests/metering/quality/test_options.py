"""What power quality measures where somebody wants it: interharmonic groups, mains signalling, flicker as it runs."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.conformance.flicker_tables import RECTANGULAR, rectangular
from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.quality.flicker_values import FlickerValues, lamp_of
from acqd.metering.quality.quantities import Options
from acqd.metering.quality.response import Response
from acqd.telemetry.quality_row import quality_rows
from tests.metering.quality.waves import metered, of_kind

RATE, F = 20_000.0, 50.0
T = np.arange(8_000) / RATE


def voltage(*parts):
    """u and i [samples, 2] of the fundamental and (Hz, V) parts."""
    u = 230 * np.sqrt(2) * np.cos(2 * np.pi * F * T)
    for k, (hertz, volts) in enumerate(parts):
        u += volts * np.sqrt(2) * np.cos(2 * np.pi * hertz * T + k)
    return np.column_stack((u, u / 100))


def independent(x, first, last):
    """RMS of all lines of numpy's DFT of ten cycles from `first` to `last` [Hz], 5 Hz apart."""
    lines = np.fft.rfft(x[:4_000]) / 4_000 * np.sqrt(2)
    at = np.arange(round(first / 5), round(last / 5) + 1)
    return np.sqrt((np.abs(lines[at]) ** 2).sum())


def measured(x, **options):
    return of_kind(metered(x, RATE, options=Options(**options)))[0]


def test_interharmonic_groups_hold_every_line_between_harmonics():
    x = voltage((105.0, 0.4), (125.0, 2.3), (145.0, 0.7), (250.0, 5.0), (255.0, 0.3))
    phase = measured(x, interharmonic_groups=True).phase
    for n in (2, 5):
        assert phase["V_ig"][0, n] == pytest.approx(independent(x[:, 0], 50 * n + 5, 50 * n + 45), abs=2e-3)
        assert phase["I_ig"][0, n] == pytest.approx(phase["V_ig"][0, n] / 100, abs=2e-5)
    assert phase["V_ih"][0, 2] == pytest.approx(2.3, abs=2e-3)  # the subgroup leaves out the neighbours of harmonics


def test_lines_up_to_100_hz_and_bands_from_2_khz_hold_what_is_there():
    parts = ((20.0, 0.8), (85.0, 0.5), (2_005.0, 0.2), (2_200.0, 0.4), (2_205.0, 0.3), (4_250.0, 0.6), (7_990.0, 0.1))
    x = voltage(*parts) + 0.25
    phase = measured(x, lines=True, bands=True).phase
    lines = [independent(x[:, 0], 5 * k, 5 * k) for k in range(1, 21)]
    assert phase["V_lines"].shape == (1, 21) and phase["V_lines"][0, 1:] == pytest.approx(
        lines, abs=0.03
    )  # f is 0.4 mHz off beside them
    assert phase["V_lines"][0, 0] == pytest.approx(0.25, abs=0.03)
    for name, width, known in (("bands", 200, 30), ("bands_1k", 1_000, 6)):
        edges = np.arange(2_000, 2_000 + width * known, width)
        expected = [independent(x[:, 0], edge + 5, edge + width) for edge in edges]
        assert phase[f"V_{name}"][0, :known] == pytest.approx(expected, abs=2e-3)
        assert np.isnan(phase[f"V_{name}"][0, known:]).all() and len(phase[f"V_{name}"][0]) == 7_000 / width
    assert phase["I_bands"][0, 11] == pytest.approx(0.006, abs=2e-5)
    (row, *_) = quality_rows(measured(x, lines=True, bands=True), "cell1", "boot1", 0)
    assert row.V_bands[0] == pytest.approx(np.hypot(0.2, 0.4), abs=1e-3) and row.V_bands[30] is None


def test_the_response_of_transformers_is_taken_out_of_the_spectrum():
    """Voltage transformers of a resonance at 2.5 kHz, current transformers that lose what is fast."""
    u, i = (
        Response((50.0, 450.0, 6_000.0), (1.0, 0.8, 2.0), (0.0, -20.0, -90.0)),
        Response((50, 450), (1, 0.5), (0, 30)),
    )

    def part(hertz, size, degrees, response=None):
        factor = 1 if response is None else complex(response.at(hertz))
        return size * np.sqrt(2) * abs(factor) * np.cos(2 * np.pi * hertz * T + np.radians(degrees) + np.angle(factor))

    true_u, true_i = (
        ((50.0, 230.0, 0.0), (250.0, 10.0, 40.0), (3_300.0, 0.4, 0.0)),
        ((50.0, 5.0, -20.0), (250.0, 2.0, 10.0)),
    )
    x = np.column_stack([sum(part(*one, how) for one in parts) for parts, how in ((true_u, u), (true_i, i))])
    one = measured(x, harmonic_powers=True, bands=True, responses=(u, i)).phase
    assert one["V_h"][0, 4] == pytest.approx(10.0, rel=1e-3) and one["I_h"][0, 4] == pytest.approx(2.0, rel=1e-3)
    assert one["V_bands"][0, 6] == pytest.approx(0.4, rel=0.01)
    assert one["P_h"][0, 4] == pytest.approx(20 * np.cos(np.radians(30)), rel=1e-3)
    assert one["V1"][0] == pytest.approx(230, rel=1e-4) and one["Irms"][0] < 5.3
    assert measured(x).phase["V_h"][0, 4] == pytest.approx(9.0, rel=1e-3)


@pytest.mark.parametrize("f", [42.6, 57.4])
def test_the_fundamental_does_not_leak_into_the_bands(f):
    u = 325 * np.cos(2 * np.pi * f * T) + 0.5 * np.sqrt(2) * np.cos(2 * np.pi * 5_100 * T)
    phase = measured(np.column_stack((u, u)), bands=True).phase
    assert phase["V_bands"][0, 15] == pytest.approx(0.5, rel=0.02)
    assert np.nanmax(np.delete(phase["V_bands"][0], [14, 15, 16])) < 0.02


def test_harmonics_have_angles_and_powers_with_direction():
    """H5 flows in and H7 out, H9 is of the voltage alone, H11 is weak beside an interharmonic; U1 begins at 100 deg."""
    turn = 2 * np.pi * F * T + np.radians(100)
    u5, i5, u7, i7 = np.radians([40.0, 10.0, -75.0, 165.0])
    u = 230 * np.cos(turn) + 8 * np.cos(5 * turn + u5) + 6 * np.cos(7 * turn + u7) + 3 * np.cos(9 * turn)
    u += 0.2 * np.cos(11 * turn) + 2 * np.cos(2 * np.pi * 555.0 * T)
    i = 5 * np.cos(turn - 0.5) + 2 * np.cos(5 * turn + i5) + 1.5 * np.cos(7 * turn + i7)
    x = np.sqrt(2) * np.column_stack((u, i, np.roll(u, 133), np.zeros_like(u)))
    one = measured(x, harmonic_powers=True)
    first, fifth, seventh, ninth, eleventh = (one.phase["P_h"][0, n - 1] for n in (1, 5, 7, 9, 11))
    assert first == pytest.approx(230 * 5 * np.cos(0.5), rel=1e-5) and first == pytest.approx(one.phase["P1"][0])
    assert fifth == pytest.approx(16 * np.cos(u5 - i5), abs=1e-3) and fifth > 0
    assert seventh == pytest.approx(9 * np.cos(u7 - i7), abs=1e-3) and seventh < 0
    assert ninth == pytest.approx(0, abs=1e-3) and eleventh == pytest.approx(0, abs=1e-3)
    assert one.phase["V_h_angle"][0, [0, 4, 6, 8]] == pytest.approx([0, 40, -75, 0], abs=0.05)
    assert one.phase["I_h_angle"][0, [0, 4, 6]] == pytest.approx([-np.degrees(0.5), 10, 165], abs=0.05)
    assert np.isnan(one.phase["V_h_angle"][0, [1, 10]]).all() and np.isnan(one.phase["I_h_angle"][0, 8])
    assert np.isnan(one.phase["I_h_angle"][1]).all() and (np.abs(one.phase["P_h"][1]) < 1e-6).all()
    assert one.phase["V_h_angle"][1, 4] == pytest.approx(40 - 5 * 133 * F * 360 / RATE + 720, abs=0.1)
    (row, *_) = quality_rows(one, "cell1", "boot1", 0)
    assert row.P_h[6] == pytest.approx(seventh, abs=1e-6) and row.V_h_angle[10] is None


@pytest.mark.parametrize("carrier", [175.0, 316.67, 1_042.0])
@pytest.mark.parametrize("share", [0.03, 0.01])
def test_mains_signalling_is_measured_from_the_four_nearest_lines(carrier, share):
    x = voltage((carrier, share * 230), (250.0, 8.0), (350.0, 5.0))
    below = 5 * int(carrier / 5)
    found = measured(x, signalling_Hz=carrier).phase["V_ms"][0]
    assert found == pytest.approx(independent(x[:, 0], below - 5, below + 10), abs=0.02)
    # Class A: 5 % of the signal, which leaks beyond four lines where it lies between two.
    assert found == pytest.approx(share * 230, rel=0.05)


@pytest.mark.parametrize(("share", "jump"), [(0.085, 0), (0.04, 0), (0, np.pi / 4)])
def test_a_carrier_that_looks_like_a_transient_is_recorded_and_a_jump_of_the_phase_is_not(share, jump):
    """175 Hz, seen once in a cycle, beats with the fundamental in every interval; a jump has lines there in one."""
    t = np.arange(40_000) / RATE
    late = t > (0.93 if jump else 1.0)
    u = np.sin(2 * np.pi * F * t + jump * late) + share * np.sin(2 * np.pi * 175 * t) * late
    options = Options(signalling_Hz=175.0, signalling_threshold=0.01, signalling_s=0.6)
    values = of_kind(metered(230 * np.sqrt(2) * np.column_stack((u, u)), RATE, options=options))
    high = [value for value in values if value.phase["V_ms"][0] > 2.3]
    assert high and all("transient" in value.flags for value in high)
    assert ["signalling" in value.flags for value in high] == [False] + [True] * (len(high) - 1)
    assert len(high) == (1 if jump else 4)


def test_without_a_word_neither_is_measured():
    phase = measured(voltage()).phase
    assert not {"V_ms", "V_ig", "V_h_angle", "P_h", "V_lines", "V_bands"} & set(phase)


def test_flicker_of_a_running_stream_is_a_row_of_each_phase():
    rate, per_minute = 2_000.0, 110
    u = rectangular("230V", 50, per_minute, RECTANGULAR["230V", 50][per_minute], rate, 614.0)
    flicker = FlickerValues(StreamFormat(rate, (1.0, 1.0), 50.0, 64), 230.0)
    codes, begin = np.column_stack((u, u)), 1_800_000_000 * 10**9 - 11 * 10**9
    values = [
        value
        for k in range(0, len(codes), 7_001)
        for value in flicker.feed(SampleBlock(codes[k : k + 7_001], k, begin + k * 500_000))
    ]
    assert [value.kind for value in values] == ["Pst", "Plt", "Pst"]  # the first two of a second before the tick
    assert values[0].flags == values[1].flags == {"gap"} and np.isnan(values[1].phase["Plt"]).all()
    (row,) = quality_rows(values[2], "cell1", "boot1", 7)
    assert (row.channel, row.aggregation, row.duration, row.flags) == ("L1", "Pst", 600.0, [])
    assert row.Pst == pytest.approx(1, abs=0.05)
    assert row.Plt is None and row.Vrms is None


def test_the_lamp_is_that_of_the_voltage():
    assert [lamp_of(volts) for volts in (100.0, 120.0, 230.0, 400.0)] == ["120V", "120V", "230V", "230V"]
