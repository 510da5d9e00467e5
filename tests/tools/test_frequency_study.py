"""A sample of the study of f: disturbances that nobody has chosen."""

from __future__ import annotations

from tools.studies.frequency.__main__ import _disturbances


def test_f_that_is_wrong_by_10_mhz_is_flagged():
    found = _disturbances(8, first=2_043)
    assert found["disturbances"] == 8 and found["first"] == 2_043 and found["silent and off by 10 mHz"] == 0
    assert found["right and flagged, %"] < 12
