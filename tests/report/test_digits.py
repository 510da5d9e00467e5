"""Numbers, intervals and the footer."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.report.digits import (
    confidence_interval,
    duration,
    interval,
    number,
    percent,
    quantity,
    quantity_with_interval,
    signed_percent,
    unbroken,
    with_error,
    year_text,
)
from acqd.report.footer import command


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.00349, "1.00"), (1234.5, "1234"), (0.000123, "0.000123"), (2.5e-9, "2.50e-09"), (9.996, "10.0"), (0.0, "0"),
     (float("nan"), "-"), (-0.0471, "-0.0471")],
)  # fmt: skip
def test_three_significant_digits(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("half", "value", "bounds"),
    [(0.088, "1.00", "0.92 to 1.09"), (0.021, "1.003", "0.982 to 1.024"), (3.1, "1.0", "-2.1 to 4.1")],
)
def test_an_error_decides_the_digits_of_its_value(half, value, bounds):
    assert with_error(1.0034, half) == value
    assert interval(1.0034 - half, 1.0034 + half) == bounds
    assert with_error(-1e-9, half) == with_error(0.0, half)


def test_an_interval_says_how_many_recordings_it_is_from():
    assert confidence_interval((0.9, 1.1), 25) == "95 %: 0.90 to 1.10 (25 recordings)"
    assert confidence_interval((0.71, 0.71), 2) == "no interval from 2 recordings"


def test_shares_and_durations():
    assert [percent(s) for s in (0, 0.0058, 0.036, 0.98)] == ["0 %", "0.58 %", "3.6 %", "98 %"]
    assert [percent(s) for s in (0.04, 0.039, 0.0996, 0.995, 0.998, 0.99994, 1.0, 1.0 - 1e-9)] == [
        "4.0 %", "3.9 %", "10 %", "99.5 %", "99.8 %", "99.99 %", "100 %", "100 %"
    ]  # fmt: skip
    assert [signed_percent(s) for s in (0.04, -0.039, -1e-9)] == ["+4.0 %", "-3.9 %", "+0.0 %"]
    assert [duration(s) for s in (44.4, 220, 36000)] == ["44.4 s", "3.67 min", "10.0 h"]


@given(st.floats(0, 1))
def test_a_percentage_is_the_share_and_all_only_where_all_is_meant(share):
    text = percent(share)
    assert abs(float(text.removesuffix(" %")) / 100 - share) <= max(0.05 * share, 1e-8)
    assert (text == "100 %") == (share > 1 - 6e-5)


def test_the_command_of_the_footer_holds_no_credentials():
    words = ["/venv/bin/python", "/venv/bin/acqd", "dataset", "build", "--power", "postgresql://me:secret@db/power"]
    assert command(words) == "acqd dataset build --power postgresql://db/power"
    assert command(["python3", "-P", "-m", "acqd", "close-loop", "ds"]) == "acqd close-loop ds"
    assert command(["python3", "-m", "tools.studies.thesis", "OUT"]) == "python -m tools.studies.thesis OUT"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(13366900.0, "W", "13.367 MW"), (230.0123, "V", "230.01 V"), (0.00123, "A", "1.2300 mA"),
     (-1500, "W", "-1.5000 kW"),
     (999999.9, "W", "1.0000 MW"), (0.9, "", "0.90000"), (0.0, "W", "0 W"), (None, "W", "-"), (float("nan"), "W", "-")],
)  # fmt: skip
def test_large_and_small_values_have_prefixes(value, unit, text):
    assert quantity(value, unit) == text


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [(-0.0814, 0.05, "-81 (-131 to -31) mWh"), (0.0, 12.0, "0 (-12 to 12) Wh"),
     (1234.0, 8.0, "1.234 (1.226 to 1.242) kWh"), (5.0, 0.0, "5.00 Wh"), (5.0, float("inf"), "5.00 Wh")],
)  # fmt: skip
def test_a_value_and_its_interval_have_one_prefix(value, half, text):
    assert quantity_with_interval(value, half, "Wh") == text


@pytest.mark.parametrize(("recordings", "text"), [(2, "20.9 kWh, 5.20 EUR"), (5, "20.9 kWh (-33.0 to 75.0), 5.20 EUR")])
def test_a_year_has_an_interval_where_recordings_suffice(recordings, text):
    year = {"kWh": 20.94, "kWh_ci95": [-33.0, 75.0], "EUR": 5.2, "recordings": recordings}
    assert year_text(year) == text
    del year["recordings"]  # as an earlier version wrote it
    assert year_text(year) == "20.9 kWh (-33.0 to 75.0), 5.20 EUR"


@pytest.mark.parametrize("text", ["8 +- 10 ms", "0.4 ± 0.1 kg", "8 +-10 ms", "23.0 J", "2.2 kg m"])
def test_no_line_ends_within_a_value_its_error_and_its_unit(text):
    assert " " not in unbroken(text) and unbroken(text).replace("\N{NO-BREAK SPACE}", " ") == text
    assert unbroken(f"a {text} b").count(" ") == 2
