"""Power that a meter did not measure, repeats, cuts off, stamps in packets, or writes in another unit."""

import numpy as np
import pytest

from acqd.dataset.align import Lag
from acqd.dataset.build import _require_placements
from acqd.dataset.placement import Alignment, Placement
from acqd.dataset.power import open_power, require_fast
from acqd.dataset.power_values import (
    interpolated_every,
    large_power,
    no_values,
    range_note,
    refreshed_every,
    two_meters_note,
)
from acqd.errors import InputError, UserError
from acqd.robot.description import load_description

TIME = 1769500000.0 + 0.04 * np.arange(3000)
POWER = 60 + 40 * np.sin(0.5 * np.arange(3000) * 0.04) ** 3 + np.random.default_rng(0).normal(0, 0.3, 3000)


def written(folder, time, P):
    path = folder / "power.csv"
    np.savetxt(path, np.column_stack([time, P]), delimiter=",", header="time,P", comments="", fmt="%.6f")
    return open_power(str(path), None, None)


@pytest.mark.parametrize("number", [0.0, -1.0, 9999.0, 65535.0])
def test_a_number_that_stands_for_no_value_is_not_measured(number):
    rows = np.random.default_rng(1).random(len(POWER)) < 0.05
    found = no_values(np.where(rows, number, POWER))
    assert found is not None
    np.testing.assert_array_equal(found[0], rows)


def test_the_only_power_below_0_is_no_value_also_where_the_power_changes_fast():
    power = POWER + np.abs(np.random.default_rng(2).normal(0, 12, len(POWER)))
    rows = np.random.default_rng(1).random(len(POWER)) < 0.02
    found = no_values(np.where(rows, -1.0, power))
    assert found is not None
    np.testing.assert_array_equal(found[0], rows)
    assert no_values(np.round(power - 60)) is None  # a drive that feeds back


def test_values_of_a_robot_that_is_off_or_of_a_meter_with_few_digits_stay():
    off = POWER.copy()
    off[500:900] = 0.0
    for P in (POWER, np.round(POWER), np.round(POWER, -1), off):
        assert no_values(P) is None


def test_power_that_a_coarse_meter_writes_or_that_idles_stays():
    row, rng = np.arange(6000), np.random.default_rng(0)
    motion = np.where(row // 200 % 2, 300 + 120 * np.sin(row / 15), 150) + rng.normal(0, 3, 6000)
    idle = np.where(row % 60 < 20, 152.0, np.round(300 + 100 * np.sin(row % 60 * 0.15) + rng.normal(0, 4, 6000)))
    returned = motion.copy()
    for brakes in range(300, 6000, 400):
        returned[brakes : brakes + 4] = 60, 0, 0, 0  # of a meter without negative power
    for P in (returned, np.round(motion, -1), 20 * np.round(motion / 20), np.repeat(np.round(motion[::4]), 4), idle):
        assert no_values(P) is None


@pytest.mark.parametrize(
    "steps",
    [
        np.tile(np.concatenate([np.full(600, 0.1), np.full(90, 2.0)]), 4),
        np.tile(np.concatenate([np.full(600, 0.04), np.full(30, 1.0)]), 4),
        np.where(np.random.default_rng(1).random(3000) < 0.1, np.random.default_rng(2).uniform(1, 4, 3000), 0.2),
        np.where(np.random.default_rng(1).random(3000) < 0.02, np.random.default_rng(2).uniform(2, 4.9, 3000), 0.04),
    ],
)
def test_true_times_of_a_meter_that_rests_or_loses_rows_stay(tmp_path, steps):
    time = np.round(TIME[0] + np.cumsum(steps), 6)
    stream = written(tmp_path, time, 200 + 100 * np.sin(0.01 * np.arange(len(time)) ** 1.1))
    assert np.abs(stream.time_ns * 1e-9 - time).max() < 1e-5
    assert stream.stamp_error_s == 0.0 and not stream.notes


def test_a_meter_that_repeats_its_values_is_said_with_its_rate(tmp_path):
    held = POWER[np.arange(len(POWER)) // 5 * 5]
    assert refreshed_every(held) == 5
    switched = np.where(np.arange(5000) // 5 % 2, 400.0, 150.0) + (np.arange(5000) % 50 == 0)
    plateaus = np.where(np.arange(5000) // 7 % 2, 300 + np.random.default_rng(3).normal(0, 0.3, 5000), 150)
    assert [refreshed_every(P) for P in (switched, plateaus, np.round(plateaus))] == [1, 1, 1]
    assert [refreshed_every(P) for P in (POWER, np.round(POWER), np.round(POWER, -1))] == [1, 1, 1]
    stream = written(tmp_path, TIME, held)
    assert stream.stamp_error_s == pytest.approx(0.1)
    assert "a new value every 0.2 s" in stream.notes[0]


def test_power_that_stops_at_a_largest_value_is_said():
    assert "the meter's range ends" in range_note(np.minimum(POWER, 80))
    assert range_note(POWER) == range_note(np.round(POWER)) == ""


@pytest.mark.parametrize("factor", [2.0, 0.3])
def test_rows_of_two_meters_in_turn_are_said(factor):
    both = np.column_stack([POWER, factor * POWER]).ravel()
    assert "are these rows of two meters?" in two_meters_note(both)


def test_noise_and_coarse_or_resting_meters_are_not_two():
    random = np.random.default_rng(5)
    for P in (POWER, np.round(POWER), 60 + random.normal(size=500), np.full(400, 12.0), np.repeat(POWER, 2)):
        assert two_meters_note(P) == ""


def test_power_in_milliwatts_is_doubted():
    robot = load_description("ur10e")
    assert "in mW" in large_power(1000 * POWER, robot)
    assert large_power(POWER, robot) == ""


def test_rows_in_packets_get_even_times_and_seldom_rows_are_refused(tmp_path):
    rows = np.arange(len(TIME))
    stream = written(tmp_path, TIME[rows // 25 * 25 + 24] + 1e-4 * (rows % 25), POWER)
    off = stream.time_ns * 1e-9 - TIME
    assert np.abs(off - np.median(off)).max() < 0.1
    assert "in packets" in stream.notes[0]
    require_fast(stream)
    with pytest.raises(InputError, match="a row every 1 s"):
        require_fast(written(tmp_path, TIME[::25], POWER[::25]))


@pytest.mark.parametrize(
    ("time", "line"), [(TIME / 86400, "in days"), (TIME.astype(np.float32).astype(float), "too few digits")]
)
def test_times_in_days_and_of_single_precision_are_refused(tmp_path, time, line):
    with pytest.raises(InputError, match=line):
        written(tmp_path, time, POWER)


def test_places_that_few_logs_find_on_no_common_clock_are_refused():
    lag = Lag(3.2, 0.6, 1.4)
    placements = [Placement(3.2, "own", lag), *[Placement(0.0, "refused", lag)] * 4]
    with pytest.raises(UserError, match=r"only 1 of 5 logs .* may be chance"):
        _require_placements(Alignment(placements, None, 0.015))


@pytest.mark.parametrize("rows", [3.7, 4, 10])
@pytest.mark.parametrize("digits", [3, 6])
def test_rows_made_by_straight_lines_between_measured_ones_are_said(tmp_path, rows, digits):
    at = np.arange(8000) / rows
    made = np.interp(at, np.arange(3000), POWER).round(digits)[at < 3000]
    stream = written(tmp_path, TIME[0] + 0.01 * np.arange(len(made)), made)
    assert stream.coarse and "straight lines" in stream.notes[0]
    assert stream.stamp_error_s == pytest.approx((round(rows) - 1) * 0.005)


@pytest.mark.parametrize("digits", [0, 1, 2, 6])
@pytest.mark.parametrize("noise_W", [0.0, 0.05, 0.5])
def test_measured_rows_are_not_taken_for_made_ones(digits, noise_W):
    t = 0.02 * np.arange(4000)
    noise = np.random.default_rng(1).normal(0, noise_W, len(t)) if noise_W else 0.0
    for P in (100 + 40 * np.sin(3 * t), 80 + 60 * np.abs(t % 2 - 1), 90 + 50 * np.clip(3 * np.sin(t), -1, 1)):
        assert interpolated_every((P + noise).round(digits)) == 1
