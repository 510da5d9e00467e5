"""Phase jumps of the bench: no wrong f without a flag."""

from __future__ import annotations

import itertools

import pytest

from acqd.metering import frequency
from tools.bench.jumps import CASES, cases, outcome


@pytest.mark.parametrize("count", [20, pytest.param(CASES, marks=pytest.mark.slow("metering"))])
def test_no_jump_leaves_a_wrong_f_or_voltage_without_a_flag(count):
    for jump in cases(count):
        found = outcome(jump)
        assert (found.wrong_f, found.wrong_V, found.elsewhere) == (0, 0, 0), jump
        assert found.flagged <= 3, jump


def test_cases_are_of_all_kinds():
    found = list(cases(CASES))
    assert {(jump.nominal, jump.phases) for jump in found} == set(itertools.product((50.0, 60.0), (1, 3)))
    assert min(abs(jump.degrees) for jump in found) < 6 and max(abs(jump.degrees) for jump in found) > 59


def test_without_the_flag_of_a_bent_phase_jumps_are_seen_to_be_wrong(monkeypatch):
    monkeypatch.setattr(frequency, "STEADY", 1.0)
    assert sum(outcome(jump).wrong_f for jump in cases(8)) > 4
