"""Reactive energy by quadrants, and demand of quarter hours, against sums that the tests make themselves."""

from __future__ import annotations

import json

import numpy as np
import pytest

from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.registers import Registers, quadrant
from acqd.metering.window import WindowBatch

RATE, FORM = 10_000.0, StreamFormat(10_000.0, (0.05, 0.001))
BLOCK_NS = 900 * 10**9


def metered(phi, seconds=4.0, watts=1_000.0, phases=1, creep_W=0.0, compiled=True):
    """Rows of `watts` VA per phase at an angle of `phi`; the voltage has harmonics, the current too."""
    t = np.arange(round(seconds * RATE)) / RATE
    columns = []
    for k in range(phases):
        angle = 2 * np.pi * (50.03 * t - k / 3)
        u = 325.27 * (np.cos(angle) + 0.05 * np.cos(5 * angle + 1))
        i = watts * 2 / 325.27 * (np.cos(angle - phi) + 0.3 * np.cos(5 * angle + 2))
        columns += [u / 0.05, i / 0.001]
    meter = Meter(StreamFormat(RATE, FORM.scale * phases), creep_W=creep_W, compiled=compiled)
    batch = meter.feed(SampleBlock(np.rint(np.array(columns).T).astype(np.int16), 0, 0))
    assert batch is not None
    return batch


@pytest.mark.parametrize(("phi", "expected"), [(0.6, "I"), (np.pi - 0.6, "II"), (np.pi + 0.6, "III"), (-0.6, "IV")])
@pytest.mark.parametrize("compiled", [True, False])
def test_reactive_energy_of_the_fundamentals_is_in_its_quadrant(phi, expected, compiled):
    batch = metered(phi, compiled=compiled)
    registers = Registers(1, 0.04)
    registers.add(batch)
    reading = registers.reading("L1")
    kvarh = 1_000 * abs(np.sin(phi)) * 0.04 * len(batch) / 3.6e6
    for name in ("I", "II", "III", "IV"):
        assert reading[f"W_reactive_{name}"] == pytest.approx(kvarh if name == expected else 0, rel=2e-4)


def test_the_total_counts_by_the_sums_of_the_phases():
    batch = metered(0.5, phases=3)
    batch.Q1[1] *= -3  # one phase capacitive: the sum is, too
    registers = Registers(3, 0.04)
    registers.add(batch)
    assert registers.reading("L1")["W_reactive_I"] > 0 and registers.reading("L2")["W_reactive_IV"] > 0
    total = registers.reading("total")
    assert total["W_reactive_I"] == 0
    assert total["W_reactive_IV"] == pytest.approx(registers.reading("L1")["W_reactive_I"], rel=1e-3)


def test_quadrants_are_numbered_as_in_the_standard():
    assert [quadrant(*pair) for pair in ((1, 1), (-1, 1), (-1, -1), (1, -1))] == [0, 1, 2, 3]


def windows(first_ns, count, kW):
    """Windows of a minute, so that a quarter hour is short."""
    at = first_ns + np.arange(count) * 60 * 10**9
    kWh = np.cumsum(np.full(count, kW / 60))[None]
    nothing = np.zeros((1, count))
    return WindowBatch(np.arange(count), at, nothing, nothing, nothing, at * 0.0, kWh, nothing, nothing,
                       [[set() for _ in range(count)]])  # fmt: skip


def test_demand_is_the_mean_of_quarter_hours_of_the_clock_and_its_maximum_stays():
    registers = Registers(1, 60.0)
    registers.add(windows(5 * 60 * 10**9, 11, 9.0))  # ten minutes only: no demand
    assert registers.reading("L1")["P_demand"] is None
    second = windows(BLOCK_NS + 60 * 10**9, 45, 2.0)
    second.imported[0] += 9.0 * 11 / 60
    second.imported[0, 15:30] += np.cumsum(np.full(15, 1.0 / 60))
    second.imported[0, 30:] += 0.25
    registers.add(second)
    reading = registers.reading("L1")
    assert reading["P_demand_max"] == pytest.approx(3_000, rel=0.07)
    assert reading["P_demand_max_start"] == 2 * 900 and reading["P_demand"] == pytest.approx(2_000, rel=0.07)


def test_a_block_that_lacks_windows_has_no_demand():
    registers = Registers(1, 60.0)
    registers.add(windows(0, 8, 1.0))
    registers.add(windows(16 * 60 * 10**9, 20, 1.0))
    assert registers.reading("L1")["P_demand_max"] is None


def test_registers_continue_after_a_restart():
    batch = metered(0.6)
    first = Registers(1, 0.04)
    first.add(batch)
    second = Registers(1, 0.04, state=json.loads(json.dumps(first.state())))
    assert second.reading("L1") == first.reading("L1")
    second.add(batch)
    assert second.reading("L1")["W_reactive_I"] == pytest.approx(2 * first.reading("L1")["W_reactive_I"])


@pytest.mark.parametrize("state", [{}, [], {"block": 1, "covered_s": 0, "channels": {"L1": [0, 0, 0, -1] * 2}}])
def test_a_state_that_is_none_is_refused(state):
    with pytest.raises(ValueError, match="registers"):
        Registers(1, 0.04, state=state)


def test_what_creeps_does_not_count_and_the_rest_counts_in_full():
    small = metered(0.6, watts=2.0)
    kept = metered(0.6, watts=2.0, creep_W=1.0)
    assert np.array_equal(kept.imported, small.imported) and small.imported[0, -1] > 0
    creeping = metered(0.6, watts=2.0, creep_W=4.0)
    assert not creeping.imported.any() and np.array_equal(creeping.P, small.P)
    assert np.array_equal(metered(0.6, watts=2.0, creep_W=4.0, compiled=False).imported, creeping.imported)
    registers = Registers(1, 0.04, creep_W=4.0)
    registers.add(small)
    assert registers.reading("L1")["W_reactive_I"] == 0


def test_registers_continue_from_numbers_and_never_go_back():
    registers = Registers(3, 0.04)
    registers.add(metered(0.6, phases=3))
    again = Registers(3, 0.04)
    again.advance(registers.numbers())
    assert again.state() == registers.state()
    before = registers.state()
    registers.advance(Registers(3, 0.04).numbers())  # of an earlier time
    assert registers.state() == before


@pytest.mark.parametrize("numbers", [[], [0.0] * 9, [0.0, 0.0, -1.0, *[0.0] * 7], [0.0, np.nan, *[0.0] * 8]])
def test_numbers_of_other_registers_are_refused(numbers):
    with pytest.raises(ValueError, match=r"registers|impossible"):
        Registers(1, 0.04).advance(numbers)
