"""Charts of lines."""

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.report.lines import MOST_POINTS, Chart, Line, Panel, _path, _scale, ticks
from tests.report.charts import chart


@pytest.mark.parametrize(
    ("low", "high", "count", "expected"),
    [
        (0, 10, 5, [0, 2, 4, 6, 8, 10]),
        (-0.26, 0.31, 3, [-0.2, 0, 0.2]),
        (154, 262, 3, [160, 180, 200, 220, 240, 260]),
        (5, 5, 3, [5]),
    ],
)
def test_ticks_are_round_numbers_within_the_range(low, high, count, expected):
    assert ticks(low, high, count) == pytest.approx(expected)


def test_an_unknown_value_interrupts_the_line_and_lines_stay_within_their_panel():
    drawing = chart().svg(960)
    path = re.search(r'class="ink" d="([^"]*)"', drawing)[1]
    assert path.count("M") == 2
    heights = [float(pair.split()[1]) for pair in re.split("[ML]", path)[1:]]
    assert min(heights) >= 6 and max(heights) <= 6 + 260


def test_a_value_between_unknown_ones_is_a_dot_and_a_single_value_has_an_axis():
    assert _path(np.arange(5.0), np.array([1.0, 2.0, np.nan, 3.0, np.nan])) == "M0 1L1 2M3 3h0"
    low, high, marks = _scale(Panel("kWh", [Line("energy", np.array([0.208398, np.nan]))]), 260)
    assert low < 0.19 and high > 0.22 and len({f"{mark:g}" for mark in marks}) == len(marks) >= 3


@pytest.mark.parametrize("days", [1, 2, 31])
def test_sums_are_bars_from_zero_and_a_single_one_is_seen(days):
    values = np.linspace(9.0, 10.0, days)
    values[5:6] = np.nan
    day = np.arange(1.0, days + 1)
    drawing = Chart(day, "day", [Panel("energy [kWh]", [Line("energy", values)], bars=True)], "Days").svg(960)
    bars = re.findall(r"M([\d.]+) ([\d.]+)V([\d.]+)H([\d.]+)V", re.search(r'class="bar ink" d="([^"]*)"', drawing)[1])
    assert len(bars) == np.isfinite(values).sum()
    left, foot, top, right = np.array(bars, dtype=float).T
    assert foot - top == pytest.approx(values[np.isfinite(values)] * (foot - top)[0] / values[0], abs=0.2)
    assert min(left) > 62 and max(right) < 952 and (left[1:] > right[:-1]).all() and min(right - left) > 15
    first, last = (float(re.search(rf'data-{end}="([^"]*)"', drawing)[1]) for end in ("from", "to"))
    assert first == pytest.approx((left[0] + right[0]) / 2, abs=0.2)
    assert last == pytest.approx((left[-1] + right[-1]) / 2, abs=0.2)
    numbers = re.findall(r'text-anchor="middle">([\d.]+)<', drawing)
    assert numbers and all(float(number) in day for number in numbers)


def test_the_values_for_the_pointer_cannot_end_their_script():
    text = chart().values()
    values = json.loads(text)
    assert "</script>" not in text and values["names"][1] == "</script><b> P [W]"
    assert values["rows"][0][3] is None and values["rows"][0][0] == 200


def test_long_series_are_thinned():
    whole = chart(10 * MOST_POINTS)
    long = whole.thinned()
    assert len(long.x) == len(long.panels[0].lines[0].values) <= MOST_POINTS
    assert (long.x[0], long.x[-1]) == (whole.x[0], whole.x[-1]) and (np.diff(long.x) > 0).all()


def test_a_single_peak_survives_the_thinning():
    whole = chart(10 * MOST_POINTS)
    whole.panels[0].lines[0].values[12_347] = 9e6
    assert np.nanmax(whole.thinned().panels[0].lines[0].values) == 9e6


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4), st.integers(3, 12))
def test_an_axis_has_at_least_three_numbers(low, span, count):
    found = ticks(low, low + span, count)
    assert 3 <= len(found) <= 2 * count + 1
    assert low - 1e-6 * span <= found[0] and found[-1] <= low + span * (1 + 1e-6)


def test_labels_of_low_panels_stay_beside_their_panels():
    names = ("shoulder_pan", "shoulder_lift")
    t = np.arange(9.0)
    low = Chart(t, "t [s]", [Panel(name, [Line("position", t)], 90) for name in names], "positions")
    places = [float(y) for y in re.findall(r"translate\(13 ([\d.]+)\)", low.svg(400, 0.75))]
    assert places[0] >= 6.5 * len(names[0]) / 2 and places[1] - places[0] >= 6.5 * (len(names[0]) + len(names[1])) / 2
