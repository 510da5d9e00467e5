"""Rows at the ends of a motion whose accelerations are not known."""

import numpy as np
import pytest

from acqd.robot.log_ends import sentence, unknown_ends

STEP_S = 0.04


def ends_of(q, known=None):
    return np.flatnonzero(unknown_ends(q, np.ones(len(q), bool) if known is None else known, STEP_S)).tolist()


@pytest.mark.parametrize(("speed", "rows"), [(0.02, []), (0.03, [0, 49]), (-0.5, [0, 49])])
def test_ends_in_motion_are_unknown(speed, rows):
    q = np.zeros((50, 3))
    q[:, 1] = speed * STEP_S * np.arange(50)
    assert ends_of(q) == rows


def test_every_run_of_known_angles_has_ends():
    q = np.arange(100)[:, None] * 0.01
    q[:30] = q[30]
    known = np.ones(100, bool)
    known[60:63] = False
    assert ends_of(q, known) == [59, 63, 99]
    known[65:70] = False  # two rows between gaps have no ends to spare
    assert ends_of(q, known) == [59, 70, 99]


def test_a_user_hears_of_unknown_rows_only():
    assert sentence(0, STEP_S) == ""
    assert "2 rows of 40 ms at its ends are in motion" in sentence(2, STEP_S)
