"""The energy register."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from acqd.metering.energy import EnergyRegister
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
    for _ in range(50):
        register.add(hours_of_windows)
    # The rest of the year in one step, as only integers can do it, then one more window.
    register._imported[0] += window * (788_400_000 - 50 * 90_000)
    before = register.reading()[0][0]
    after = register.add(np.array([[float(window)]])).imported[0, 0]
    exact = Fraction(window) * Fraction(unit)
    assert abs(before / float(exact * 788_400_000) - 1) < 1e-15
    assert abs((register.reading()[0][0] - before) / float(exact) - 1) < 1e-6 and after > before


def test_import_and_export_are_kept_apart():
    imports, exports = make_mains(50.0, seconds=2, phases=1), make_mains(50.0, seconds=2, phases=1, lag=np.pi)
    imports.codes = np.concatenate([imports.codes, exports.codes])
    batch = meter_all(imports)
    assert batch.P[0, 5] > 0 > batch.P[0, -5]
    assert batch.imported[0, -1] == pytest.approx(-(batch.exported[0, -1] * imports.P / exports.P), rel=1e-3)
    assert batch.W[0, -1] == pytest.approx(batch.imported[0, -1] - batch.exported[0, -1])
    assert (np.diff(batch.imported[0]) >= 0).all() and (np.diff(batch.exported[0]) >= 0).all()


def test_energy_goes_on_from_its_last_reading():
    mains = make_mains(50.0, seconds=1, phases=1)
    fresh = meter_all(mains)
    again = meter_all(mains, energy=[(12.5, 0.25)])
    np.testing.assert_allclose(again.imported[0] - fresh.imported[0], 12.5, atol=1e-12)
    np.testing.assert_allclose(again.exported[0], 0.25, atol=1e-12)
