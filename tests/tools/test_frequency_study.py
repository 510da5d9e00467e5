"""A sample of the study of f: disturbances that nobody has chosen."""

from __future__ import annotations

from tools.studies.frequency.__main__ import _disturbances
from tools.studies.frequency.further import further_disturbance
from tools.studies.frequency.waves import random_disturbance


def test_f_that_is_wrong_by_10_mhz_is_flagged():
    found = _disturbances("near f", random_disturbance, range(2_043, 2_051))
    assert found["disturbances"] == 8 and found["first"] == 2_043 and found["silent and off by 10 mHz"] == 0
    assert found["right and flagged, %"] < 12


def test_further_kinds_make_few_doubts():
    found = _disturbances("further", further_disturbance, range(36, 44))
    assert found["right and flagged, %"] < 12 and found["disturbances"] == 8
