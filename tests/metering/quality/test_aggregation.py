"""150/180-cycle, 10 min, 2 h and 10 s values of values with a known mean."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.metering.quality.aggregation import Aggregate
from acqd.metering.quality.quantities import deviations
from acqd.metering.quality.ten_seconds import TenSeconds
from acqd.metering.quality.tick_values import TickValues
from acqd.metering.quality.values import QualityValues
from tests.metering.quality.waves import T0, metered, of_kind, three_phases


def value(k=0, f=50.0, rocof=0.0, flags=(), duration=0.2, **phase):
    return QualityValues(
        "10/12", T0 + round(k * duration * 1e9), duration, 1, f, rocof,
        {name: np.atleast_1d(np.asarray(x, dtype=float)) for name, x in phase.items()}, {}, frozenset(flags),
        [frozenset()],
    )  # fmt: skip


@given(st.lists(st.floats(0, 1e4), min_size=1, max_size=20))
def test_rms_for_magnitudes_and_mean_for_powers(values):
    aggregate = Aggregate("150/180")
    for k, x in enumerate(values):
        aggregate.add(value(k, Vrms=x, P=-x, V_h=[x, 2 * x]))
    found = aggregate.close()
    rms = math.sqrt(math.fsum(x * x for x in values) / len(values))
    assert found.phase["Vrms"][0] == pytest.approx(rms)
    assert found.phase["V_h"] == pytest.approx(np.array([rms, 2 * rms]))
    assert found.phase["P"][0] == pytest.approx(-math.fsum(values) / len(values), abs=1e-9)
    assert found.intervals == len(values) and found.duration == pytest.approx(0.2 * len(values))


def test_deviations_are_of_the_root_of_what_lies_below_and_above():
    """IEC 61000-4-30, section 5.12: the intervals of the other side count as the declared voltage."""
    V = [207.0, 241.5, 230.0, 218.5]
    aggregate = Aggregate("10min")
    for k, x in enumerate(V):
        aggregate.add(value(k, **deviations(np.array([x]), 230.0)))
    found = aggregate.close()
    below, above = (math.sqrt(math.fsum(side(x, 230.0) ** 2 for x in V) / 4) for side in (min, max))
    assert found.phase["V_under"][0] == pytest.approx((230 - below) / 2.3)
    assert found.phase["V_over"][0] == pytest.approx((above - 230) / 2.3)
    twice = Aggregate("2h")
    twice.add(found)
    twice.add(found)
    assert twice.close().phase["V_under"] == pytest.approx(found.phase["V_under"])


@pytest.mark.parametrize(
    ("volts", "under", "over"), [(207.0, 10.0, 0.0), (241.5, 0.0, 5.0), (0.0, 100.0, 0.0), (12e3, np.nan, np.nan)]
)
def test_deviations_of_an_interval_are_of_the_declared_voltage(volts, under, over):
    x = three_phases(2 * np.pi * 50 * np.arange(2_000) / 2_000, volts=volts)
    for one in of_kind(metered(x, 2_000.0)):
        assert one.phase["V_under"] == pytest.approx([under] * 3, abs=1e-3, nan_ok=True)
        assert one.phase["V_over"] == pytest.approx([over] * 3, abs=1e-3, nan_ok=True)


def test_angles_are_averaged_on_the_circle_and_the_unknown_is_left_out():
    aggregate = Aggregate("10min")
    for angle in (179.0, -177.0, np.nan):
        aggregate.add(value(V1_angle=angle, f=np.nan, flags=["dip"] if angle < 0 else []))
    found = aggregate.close("gap")
    assert abs(found.phase["V1_angle"][0]) == pytest.approx(179.0)
    assert math.isnan(found.f) and found.flags == {"dip", "gap"}


@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_frequency_of_ten_seconds_of_a_ramp(slope):
    rate = 2_000.0
    t = np.arange(int(24 * rate)) / rate
    angle = 2 * np.pi * (49 * t + slope * t * t / 2 * (t > 0))
    values = of_kind(metered(three_phases(angle), rate, t0=T0 + 3 * 10**9), "10s")
    assert [one.utc_ns - T0 for one in values] == [0, 10 * 10**9]
    assert math.isnan(values[0].f) and "gap" in values[0].flags  # 7 s of it only
    assert values[1].f == pytest.approx(49 + slope * 12, abs=2e-3)
    assert values[1].flags == frozenset()


def test_ten_seconds_across_a_tick_count_no_time_twice():
    frequency, done = TenSeconds(), []
    for k in range(60):
        done += frequency.add(value(k, f=50.0))
        if k == 24:  # the interval at the tick begins inside the one before
            done += frequency.add(value(k + 0.4, f=50.0))
    assert [one.f for one in done] == pytest.approx([50.0])


def test_ten_minutes_and_two_hours():
    """From one minute before a two-hour tick on, in intervals of 2 s."""
    hours = 7_200 * 10**9
    begin = (T0 // hours + 1) * hours - 60 * 10**9
    ticks, done = TickValues(), []
    for k in range(30 + 3_600 + 1):
        flags = ["dip"] if k == 100 else []
        one = value(k, duration=2.0, Vrms=230 + (k % 2), f=49 + k / 3_600, flags=flags)
        done += ticks.add(replace(one, utc_ns=begin + 2 * k * 10**9))
    assert [one.kind for one in done] == ["10min", "2h"] + 12 * ["10min"] + ["2h"]
    assert [sorted(one.flags) for one in done] == [["gap"], ["gap"], ["dip"], *([[]] * 11), ["dip"]]
    for one in done[2:14]:
        assert one.utc_ns % (600 * 10**9) == 0 and one.intervals == 300
        assert one.phase["Vrms"][0] == pytest.approx(math.sqrt((230**2 + 231**2) / 2))
    assert done[14].intervals == 3_600 and done[14].f == pytest.approx(49.508, abs=1e-3)
