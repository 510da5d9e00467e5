"""Readings that are plausible."""

from __future__ import annotations

import pytest

from acqd.sources.meters import load_profile
from acqd.sources.meters.plausible import judge


@pytest.mark.parametrize(
    "changed",
    [
        {"total.S": 364.0, "total.P": -100.0, "L1.P": -2300.0},  # one phase feeds in: vector sums
        {"L2.Vrms": 40.0, "L2.Irms": 0.0, "L2.P": 0.0, "total.P": 4600.0, "total.S": 4600.0},  # an open phase
        {"L1.P": 1430.0, "L1.PF": 0.97},  # a rectifier: PF is cos(phi), the current is distorted
        {"L2.P": -2300.0},  # a reversed current transformer
    ],
)
def test_legitimate_installations_are_not_refused(changed):
    values: dict[str, float | None] = {"f": 50.0, "total.P": 6900.0, "total.S": 6900.0}
    for phase in (1, 2, 3):
        values |= {f"L{phase}.Vrms": 230.0, f"L{phase}.Irms": 10.0, f"L{phase}.P": 2300.0, f"L{phase}.PF": 1.0}
    assert judge(load_profile("em340"), values | changed, 230.0).faults == ()


def test_plausible_values_of_small_and_reactive_loads_are_not_refused():
    profile = load_profile("em340")
    for amperes, pf in ((0.0, 0.0), (0.004, 1.0), (0.05, 0.2), (60.0, -0.98)):
        values: dict[str, float | None] = {"f": 50.0}
        for phase in (1, 2, 3):
            product = 230.0 * amperes
            values |= {f"L{phase}.Vrms": 230.0, f"L{phase}.Irms": amperes, f"L{phase}.P": round(product * pf, 1),
                       f"L{phase}.S": round(product, 1), f"L{phase}.PF": pf}  # fmt: skip
        assert judge(profile, values, 230.0).faults == (), (amperes, pf)
