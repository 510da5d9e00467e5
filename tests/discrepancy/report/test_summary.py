"""What a report says is to be done."""

from dataclasses import replace

import pytest

from acqd.discrepancy.report.summary import _motion_helps
from tests.discrepancy.report.subjects import found


@pytest.mark.parametrize(
    ("confidence", "family", "helps"),
    [(0.953, (), False), (0.9, (), True), (0.97, (("gravity_bias", "link 7"),), True)],
)
def test_a_motion_is_asked_for_where_a_name_is_in_doubt_only(confidence, family, helps):
    named = found("payload", {"mass": (1.5, 0.2)})
    one = replace(named, confidence=confidence, family=family, alternatives=(("gravity_bias", 0.027),))
    assert _motion_helps(one) is helps
