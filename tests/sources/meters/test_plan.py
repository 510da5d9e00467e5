"""Reads of a round: few, and told apart by their lengths."""

from __future__ import annotations

import pytest

from acqd.sources.meters.plan import GAP, make_plan
from acqd.sources.meters.profile import known_profiles, load_profile


@pytest.mark.parametrize("gap", [GAP, 0])
@pytest.mark.parametrize("name", known_profiles())
def test_no_two_reads_in_a_row_have_one_length(name, gap):
    profile = load_profile(name)
    plan = make_plan(profile, gap)
    sizes = [(function, count) for function, _, count in plan.reads]
    alike = sum(one == before for one, before in zip(sizes, [sizes[-1], *sizes], strict=False)) if len(sizes) > 1 else 0
    assert alike == (4 if (name, gap) == ("sdm120", 0) else 0)  # five registers of two words, one of six
    answers = [bytes(2 * count) for _, count in sizes]
    for register in profile.quantities.values():
        assert len(plan.bytes_of(register, answers)) == 2 * register.width
