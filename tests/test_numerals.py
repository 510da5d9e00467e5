"""Whole numbers in texts of others."""

from __future__ import annotations

import pytest

from acqd.numerals import whole_number


@pytest.mark.parametrize(("text", "number"), [("0", 0), ("007", 7), ("999999999", 999_999_999)])
def test_digits_are_a_number(text, number):
    assert whole_number(text) == number


@pytest.mark.parametrize("text", ["", " 1", "+1", "-1", "1.0", "\u00b2", "\u0663", "1_0", "1" * 10, "9" * 5000])
def test_anything_else_is_none(text):
    assert whole_number(text) is None
