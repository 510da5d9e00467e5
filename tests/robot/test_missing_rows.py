"""Rows at even times between which something is missing: told from every motion within three times the limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.robot.description import load_description
from acqd.robot.missing_rows import missing_rows

UR10E = load_description("ur10e")
NO_STEP = np.zeros(6)


def driven(seed, step_s, share):
    """Angles [T, 6] of joints that jump between full drive and full braking, at a share of their accelerations."""
    random = np.random.default_rng(seed)
    substeps = 20
    drive = random.choice([-1.0, 1.0], (60, 6)).repeat(4 * substeps, axis=0)
    qdd = share * UR10E.acceleration * drive
    qd = np.cumsum(qdd, axis=0) * step_s / substeps
    q = np.cumsum(qd, axis=0) * step_s / substeps
    return np.arange(240) * step_s, q[::substeps]


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.004, 0.02, 0.04, 0.1]), st.floats(0.1, 3.0))
def test_no_motion_within_three_times_the_accelerations_lacks_rows(seed, step_s, share):
    time, q = driven(seed, step_s, share)
    assert missing_rows(time, q, NO_STEP, UR10E) is None


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.004, 0.02, 0.04]), st.floats(6.0, 60.0), st.integers(0, 5))
def test_a_jump_of_some_degrees_is_named_by_row_and_joint(seed, step_s, degrees, axis):
    time, q = driven(seed, step_s, 0.3)
    way, around = q[100, axis] - q[99, axis], (q[99] - q[98] + q[101] - q[100])[axis] / 2
    q[100:, axis] += np.copysign(np.radians(degrees) + abs(around), way)
    row, text = missing_rows(time, q, NO_STEP, UR10E)
    assert row == 100 and text.startswith(UR10E.joint[axis].name) and "rows are missing" in text


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.002, 0.008, 0.04]), st.integers(5, 200))
def test_a_row_that_a_recorder_has_lost_is_no_part_of_the_motion(seed, step_s, row):
    time, q = driven(seed, step_s, 0.3)
    assert missing_rows(time[:-1], np.delete(q, row, axis=0), NO_STEP, UR10E) is None


@pytest.mark.parametrize("step_s", [0.04, 0.1])
def test_rounded_angles_lack_no_rows(step_s):
    time, q = driven(1, step_s, 0.5)
    digits = np.radians(5.0)
    assert missing_rows(time, digits * np.round(q / digits), np.full(6, digits), UR10E) is None


def test_rows_around_a_gap_in_time_are_not_compared():
    time, q = driven(2, 0.04, 0.5)
    q[100:] += 0.5
    time[100:] += 1.0
    assert missing_rows(time, q, NO_STEP, UR10E) is None
