"""The counter of samples within a second."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.sources.sampled_values.counter import SecondCounter


@settings(max_examples=200)
@given(
    steps=st.lists(st.tuples(st.integers(1, 100_000), st.integers(1, 40)), min_size=1, max_size=30),
    late=st.floats(-0.2, 0.2),
)
def test_gaps_of_any_length_are_unwrapped_with_the_help_of_the_clock(steps, late):
    counter, number = SecondCounter(4800), 17
    counter.unwrap(np.array([number]), 0)
    base = number
    for gap, count in steps:
        number += gap
        arrival = (number - base) / 4800 + late
        numbers = counter.unwrap((number + np.arange(count)) % 4800, round(arrival * 1e9))
        np.testing.assert_array_equal(numbers, number + np.arange(count))
        number += count - 1
