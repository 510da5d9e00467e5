"""Energy and cost of a cause per year."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.report.cost import cost_figure, cost_of, size_error
from acqd.models.yearly import HOURS_PER_YEAR, Duty
from tests.builders import STEP, grey, recording
from tests.discrepancy.report.subjects import found, subject_with


def test_a_constant_load_costs_its_power_and_its_size_is_the_interval():
    model = grey()
    segments = [recording(model, k, rows=120) for k in range(6)]
    data = SimpleNamespace(step_s=STEP)
    closed = SimpleNamespace(subject=subject_with(model, held_out=segments, data=data))
    closed.subject.model = model
    load = found("offset_shift", {"power": (2.0, 0.4)}, where="cabinet", unit="W")
    load = replace(load, term=replace(load.term, coefficients=np.array([2.0])))
    cost = cost_of(closed, load, Duty(None, 0.5))
    assert cost.kWh == pytest.approx(2.0 * HOURS_PER_YEAR / 1000) and pytest.approx(0.5 * cost.kWh) == cost.EUR
    assert cost.half_kWh == pytest.approx(0.2 * cost.kWh)
    figure = cost_figure(load, cost)
    assert figure.value == "+17.5 kWh, +8.76 EUR" and "7.0 to 10.5 EUR" in figure.note
    assert cost_of(closed, found("meter_gain", {"gain error": (0.1, 0.01)}), Duty()) is None


def test_the_error_of_several_sizes_is_that_of_the_largest():
    sizes = found("offset_shift", {"one": (10.0, 1.0), "other": (0.0, 0.1)})
    assert size_error(sizes.term) == pytest.approx(0.1, rel=0.01)
