"""Ranges compared with plain sets."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from acqd.telemetry.ranges import Ranges

_operation = st.tuples(st.booleans(), st.integers(0, 60), st.integers(0, 12))


@given(st.lists(_operation, max_size=40))
def test_ranges_are_a_set_of_integers(operations):
    ranges, plain = Ranges(), set()
    for adds, first, more in operations:
        numbers = set(range(first, first + more + 1))
        if adds:
            assert ranges.add(first, first + more) == len(numbers - plain)
            plain |= numbers
        else:
            assert ranges.remove(first, first + more) == len(numbers & plain)
            plain -= numbers
        assert {k for k in range(80) if k in ranges} == plain
        assert len(ranges) == len(plain)
        pairs = list(ranges)
        assert {k for a, b in pairs for k in range(a, b + 1)} == plain
        assert all(b + 1 < a for (_, b), (a, _) in itertools.pairwise(pairs)), "ranges that touch are one"
    assert Ranges(ranges) == ranges


@given(st.lists(st.integers(0, 9), max_size=6), st.lists(st.integers(0, 9) | st.just(3), max_size=6))
def test_numbers_that_are_added_together_are_those_that_are_added_alone(before, numbers):
    together, alone = Ranges((k, k) for k in before), Ranges((k, k) for k in before)
    for added in (numbers, sorted(numbers), list(range(2, 2 + len(numbers)))):
        together.add_all(added)
        for k in added:
            alone.add(k, k)
        assert together == alone and len(together) == len(alone)
