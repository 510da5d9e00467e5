"""The energy register."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.energy import EnergyRegister, no_load_W
from tests.mains import make_mains
from tests.metering.streams import meter_all


def test_energy_is_the_gapless_sum_of_every_sample():
    mains = make_mains(50.3, seconds=4.0, phases=2)
    batch = meter_all(mains, cuts=[777, 12_345])
    for phase in range(2):
        exact = sum(
            int(u) * int(i)
            for u, i in zip(
                mains.codes[: 800 * len(batch), 2 * phase].tolist(),
                mains.codes[: 800 * len(batch), 2 * phase + 1].tolist(),
                strict=True,
            )
        )
        kwh = Fraction(exact) * Fraction(mains.scale[0]) * Fraction(mains.scale[1]) / 20_000 / 3_600_000
        assert abs(batch.W[phase, -1] / float(kwh) - 1) < 1e-14


def test_a_year_of_energy_loses_nothing():
    unit = EnergyRegister.kwh_per_count(0.0225, 0.000281, 20_000.0)
    register = EnergyRegister([unit])
    window = 800 * 32_767**2 - 1
    hours_of_windows = np.full((1, 90_000), float(window))
    for _ in range(5):
        register.add(hours_of_windows)
    # The rest of the year in one step, as only integers can do it, then one more window.
    state = register.state()
    state["imported"][0] += window * (788_400_000 - 5 * 90_000)
    register.restore(state)
    before = register.reading()[0][0]
    after = register.add(np.array([[float(window)]])).imported[0, 0]
    exact = Fraction(window) * Fraction(unit)
    assert abs(before / float(exact * 788_400_000) - 1) < 1e-15
    assert abs((register.reading()[0][0] - before) / float(exact) - 1) < 1e-6 and after > before


@settings(max_examples=40, deadline=None)
@given(
    counts=st.lists(
        st.tuples(*[st.integers(-800 * 32_768**2, 800 * 32_768**2) | st.integers(-3, 3)] * 2), min_size=2, max_size=12
    ),
    start=st.integers(0, 2**40) | st.integers(2**53 - 9, 2**70),
    creep=st.sampled_from([0.0, 2.0, 1e9]),
)
def test_windows_added_together_read_as_windows_added_one_by_one(counts, start, creep):
    unit = EnergyRegister.kwh_per_count(0.0225, 0.000281, 20_000.0)
    begin = [(start * unit, 0.0), (0.25, start * unit)]
    together, singly = (EnergyRegister([unit, unit * 1.1], begin, creep_kWh=creep * unit) for _ in range(2))
    columns = together.add(np.array(counts, float).T)
    readings = np.array([singly.add_window([float(sum_) for sum_ in window]) for window in counts]).T
    assert np.array_equal(np.concatenate((columns.imported, columns.exported)), readings)
    assert together.state() == singly.state()


def test_import_and_export_are_kept_apart():
    imports, exports = make_mains(50.0, seconds=2, phases=1), make_mains(50.0, seconds=2, phases=1, lag=np.pi)
    imports.codes = np.concatenate([imports.codes, exports.codes])
    batch = meter_all(imports)
    assert batch.P[0, 5] > 0 > batch.P[0, -5]
    assert batch.imported[0, -1] == pytest.approx(-(batch.exported[0, -1] * imports.P / exports.P), rel=1e-3)
    assert batch.W[0, -1] == pytest.approx(batch.imported[0, -1] - batch.exported[0, -1])
    assert (np.diff(batch.imported[0]) >= 0).all() and (np.diff(batch.exported[0]) >= 0).all()


@settings(max_examples=6, deadline=None)
@given(
    power=st.sampled_from([1.0, -1.0]),
    mode=st.sampled_from(["synchronous", "fixed"]),
    gaps=st.lists(st.tuples(st.integers(4_000, 7_000), st.integers(1, 3_000)), min_size=1, max_size=12),
)
@example(power=1.0, mode="synchronous", gaps=[(4_010 + 17 * k, 1_203 + 40 * k) for k in range(12)])
def test_gaps_export_nothing_that_an_inductive_load_has_not_exported(power, mode, gaps):
    """Less than a cycle before or after a gap: reactive power swings, and its energy may have the other sign."""
    mains = make_mains(50.02, seconds=7, phases=1, lag=np.arccos(0.6) if power > 0 else np.pi - np.arccos(0.6))
    meter, batches, at = Meter(StreamFormat(mains.rate, mains.scale), mode=mode), [], 0
    measured = 0
    for length, lost in [*gaps, (3_000, 0)]:
        codes = mains.codes[at : at + length]
        batches.append(meter.feed(SampleBlock(codes, at, at * 50_000)))
        whole = len(codes) if lost else (at + len(codes)) // 800 * 800 - at  # the last window is not complete
        measured += int((codes[:whole, 0].astype(np.int64) * codes[:whole, 1]).sum())
        at += length + lost
    imported, exported = (np.concatenate([getattr(b, name)[0] for b in batches]) for name in ("imported", "exported"))
    assert (np.diff(power * (imported - exported)) >= 0).all()
    assert not (exported if power > 0 else imported).any()
    total = measured * EnergyRegister.kwh_per_count(*mains.scale[:2], 20_000.0)
    assert imported[-1] - exported[-1] == pytest.approx(total, rel=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    windows=st.lists(
        st.tuples(st.integers(-1000, 1000), st.sampled_from([None, 5.0, -5.0, math.nan])), min_size=1, max_size=20
    ),
    integers=st.booleans(),
)
def test_parts_of_windows_against_the_direction_are_added_with_the_next_window(windows, integers):
    """`None`: a whole window. In sum nothing is lost, and a state goes on as the register itself."""
    register, restored = (EnergyRegister([1.0], integers=integers) for _ in range(2))
    for counts, power in [*windows, (1, None)]:
        restored.restore(register.state())
        before = register.reading()[0]
        for one in (register, restored):
            one.add_window([float(counts)]) if power is None else one.add_part([float(counts)], [power])
        assert restored.state() == register.state()
        imported, exported = register.reading()[0]
        assert imported >= before[0] and exported >= before[1]
        if power is not None and not math.isnan(power):
            assert (imported - exported - before[0] + before[1]) * power >= 0
    imported, exported = register.reading()[0]
    assert imported - exported == 1 + sum(counts for counts, _ in windows)


def test_energy_goes_on_from_its_last_reading():
    mains = make_mains(50.0, seconds=1, phases=1)
    fresh = meter_all(mains)
    again = meter_all(mains, energy=[(12.5, 0.25)])
    np.testing.assert_allclose(again.imported[0] - fresh.imported[0], 12.5, atol=1e-12)
    np.testing.assert_allclose(again.exported[0], 0.25, atol=1e-12)


def test_noise_at_115_percent_without_load_counts_nothing_and_the_starting_current_does():
    """The no-load and starting conditions of IEC 62053-22, class 0.5 S, of a terminal for 5 A."""
    random = np.random.default_rng(2)
    t = np.arange(200_000) / 20_000.0
    form = StreamFormat(20_000.0, (737.2575 / 32768, 9.207527 / 32768))
    creep = no_load_W(form, 230.0)

    def counted(amperes):
        u = 1.15 * 230 * np.sqrt(2) * np.cos(2 * np.pi * 50 * t) / form.scale[0]
        i = amperes * np.sqrt(2) * np.cos(2 * np.pi * 50 * t) / form.scale[1] + 3 * random.standard_normal(len(t))
        meter = Meter(form, creep_W=creep)
        meter.feed(SampleBlock(np.rint(np.column_stack((u, i))).astype(np.int16), 0, 0))
        return meter.energy.reading()[0]

    assert counted(0.0) == (0.0, 0.0)
    imported, exported = counted(0.001 * 5)
    assert exported == 0 and imported == pytest.approx(1.15 * 230 * 0.005 * 10 / 3.6e6, rel=0.01)


def test_there_is_no_automatic_threshold_where_the_range_of_the_current_is_not_known():
    assert no_load_W(StreamFormat(4_000.0, (0.01, 0.001), bits=32), 230.0) == 0
