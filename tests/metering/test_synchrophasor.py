"""Synchrophasors of waves whose phasors are known (simulated)."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.synchrophasor import SynchrophasorMeter

WHOLE = 1_750_000_000 * 10**9  # a whole second


def reports(f, *, rate=20_000.0, late_ns=0, nominal=50.0, phases=3, cuts=(800,), lost=(0, 0), seconds=0.5):
    """Of voltages whose angle is 0.3 rad at the whole second; the first sample is `late_ns` after it."""
    form = StreamFormat(rate, (1.0, 1.0) * phases, nominal, 64)
    meter, found = SynchrophasorMeter(form, 10.0), []
    t = np.arange(round(seconds * rate)) / rate + late_ns * 1e-9
    columns = []
    for k in range(phases):
        angle = 2 * np.pi * f * t + 0.3 - 2 * np.pi * k / 3
        columns += [230 * np.sqrt(2) * np.cos(angle), 3 * np.sqrt(2) * np.cos(angle - 0.5)]
    x, first, turn = np.array(columns).T, 0, 0
    while first < len(x):
        size = cuts[turn % len(cuts)]
        stamp = WHOLE + late_ns + round(first * 1e9 / rate)
        if not lost[0] <= first < lost[1]:
            found += meter.feed(SampleBlock(x[first : first + size], first, stamp, flags=frozenset({"simulated"})))
        first, turn = first + size, turn + 1
    return found


@pytest.mark.parametrize("late_ns", [0, 123_456, 19_999_999])
@pytest.mark.parametrize(
    ("f", "nominal", "rate"), [(50.0, 50.0, 20_000.0), (48.7, 50.0, 12_800.0), (60.9, 60.0, 7_812.5)]
)
@pytest.mark.parametrize("phases", [1, 3])
def test_phasors_refer_to_utc_whenever_the_samples_begin(f, nominal, rate, late_ns, phases):
    found = reports(f, rate=rate, late_ns=late_ns, nominal=nominal, phases=phases)
    assert len(found) >= 15 and {one.flags for one in found} == {frozenset({"simulated"})}
    for one in found:
        since = (one.utc_ns - WHOLE) * 1e-9
        assert since * nominal == pytest.approx(round(since * nominal), abs=1e-6)
        truth = np.exp(1j * (2 * np.pi * (f - nominal) * since + 0.3))
        size = 1e-4 if phases == 3 else 4e-3
        assert abs(one.positive - 230 * truth) < size * 230
        assert abs(one.I[0] - 3 * truth * np.exp(-0.5j)) < 4e-3 * 3
        assert one.f == pytest.approx(f, abs=1e-4 if phases == 3 else 0.02)
        assert one.rocof == pytest.approx(0, abs=0.02 if phases == 3 else 2)


def test_reports_do_not_depend_on_how_the_stream_is_cut():
    for one, other in zip(reports(50.3), reports(50.3, cuts=(1, 799, 2_111)), strict=True):
        assert one.utc_ns == other.utc_ns and one.positive == pytest.approx(other.positive, abs=1e-9)


def test_a_gap_begins_anew_and_no_report_is_made_of_both_sides():
    found = reports(50.1, lost=(4_000, 4_800), seconds=1.0)
    for one in found:
        truth = 230 * np.exp(1j * (2 * np.pi * 0.1 * (one.utc_ns - WHOLE) * 1e-9 + 0.3))
        assert abs(one.positive - truth) < 0.03
    assert max(np.diff([one.utc_ns for one in found])) > 60_000_000


def test_without_a_voltage_there_is_no_frequency():
    form = StreamFormat(20_000.0, (1.0, 1.0), 50.0, 64)
    found = list(SynchrophasorMeter(form, 10.0).feed(SampleBlock(np.zeros((8_000, 2)), 0, WHOLE)))
    assert found and all(np.isnan(one.f) and np.isnan(one.rocof) and one.positive == 0 for one in found)
