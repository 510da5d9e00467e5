"""Power that a meter did not measure, repeats, cuts off, stamps in packets, or writes in another unit."""

import numpy as np
import pytest

from acqd.dataset.align import Lag
from acqd.dataset.build import _require_placements
from acqd.dataset.placement import Alignment, Placement
from acqd.dataset.power import open_power, require_fast
from acqd.dataset.power_values import large_power, no_values, range_note, refreshed_every
from acqd.errors import InputError, UserError
from acqd.robot.description import load_description

TIME = 1769500000.0 + 0.04 * np.arange(3000)
POWER = 60 + 40 * np.sin(0.5 * np.arange(3000) * 0.04) ** 3 + np.random.default_rng(0).normal(0, 0.3, 3000)


def written(folder, time, P):
    path = folder / "power.csv"
    np.savetxt(path, np.column_stack([time, P]), delimiter=",", header="time,P", comments="", fmt="%.6f")
    return open_power(str(path), None, None)


@pytest.mark.parametrize("number", [0.0, -1.0, 9999.0, 65535.0])
@pytest.mark.parametrize("middle", [0.0, 60.0])
def test_a_number_that_stands_for_no_value_is_not_measured(number, middle):
    P = POWER - middle  # power of a small drive goes through 0
    rows = np.random.default_rng(1).random(len(P)) < 0.05
    found = no_values(np.where(rows, number, P))
    assert found is not None
    np.testing.assert_array_equal(found[0], rows)


def test_values_of_a_robot_that_is_off_or_of_a_meter_with_few_digits_stay():
    off = POWER.copy()
    off[500:900] = 0.0
    for P in (POWER, np.round(POWER), np.round(POWER, -1), off):
        assert no_values(P) is None


def test_a_meter_that_repeats_its_values_is_said_with_its_rate(tmp_path):
    held = POWER[np.arange(len(POWER)) // 5 * 5]
    assert refreshed_every(held) == 5
    assert [refreshed_every(P) for P in (POWER, np.round(POWER), np.round(POWER, -1))] == [1, 1, 1]
    stream = written(tmp_path, TIME, held)
    assert stream.stamp_error_s == pytest.approx(0.1)
    assert "a new value every 0.2 s" in stream.notes[0]


def test_power_that_stops_at_a_largest_value_is_said():
    assert "the meter's range ends" in range_note(np.minimum(POWER, 80))
    assert range_note(POWER) == range_note(np.round(POWER)) == ""


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
