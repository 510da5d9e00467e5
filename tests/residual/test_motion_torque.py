"""Torque as a function of motion: it holds on motions that it has not seen, in any unit, from a few recordings."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.residual.motion_torque import JointRows, fitted, unseen_residuals
from tests.builders import grey
from tests.discrepancy.joints.test_witness import logged

NOISE_NM = 0.3


@pytest.fixture(scope="module")
def model():
    return grey()


def rows_of(model, count, *, sensor, factor=1.0):
    segments = [logged(model, number, 1, sensor=sensor) for number in range(count)]
    if not sensor:
        segments = [replace(s, channels={"current": factor * s.channels["current"]}) for s in segments]
    return [JointRows.of(model, segment, "link" if sensor else "motor") for segment in segments]


def size(residuals):
    return np.sqrt(np.nanmean(np.square(np.concatenate(residuals)), axis=0))


@pytest.mark.parametrize("count", [3, 12])
def test_a_few_recordings_tell_the_torque_of_motions_that_they_do_not_hold(model, count):
    """The grey box knows what the motions do not determine: without a prior, three recordings give 100 Nm."""
    left = size(unseen_residuals(model, "link", rows_of(model, count, sensor=True), 5))
    assert (left < 2 * NOISE_NM).all()


def test_currents_in_any_unit_and_of_any_sign_tell_the_same(model):
    ampere, other = (rows_of(model, 6, sensor=False, factor=factor) for factor in (1.0, -1000.0))
    one, thousand = (unseen_residuals(model, "motor", rows, 5) for rows in (ampere, other))
    np.testing.assert_allclose(np.concatenate(thousand), -1000 * np.concatenate(one), rtol=1e-5, atol=1e-4)


def test_a_joint_at_rest_says_nothing_about_its_motor(model):
    current = rows_of(model, 1, sensor=False)[0]
    speed = np.abs(logged(model, 0, 1).motion(model.step_s)[1])
    assert current.known[speed < 0.02].sum() == 0 and 0.3 < current.known.mean() < 0.95
    residual = current.residual(fitted(model, "motor", current.products()))
    assert (np.isnan(residual) == (current.known == 0)).all()


def test_recordings_without_torques_have_no_rows(model):
    segment = logged(model, 0, 1, sensor=True)
    assert JointRows.of(model, segment, "motor") is None
    assert JointRows.of(model, replace(segment, tau=np.zeros_like(segment.q)), "link") is None


@settings(max_examples=20, deadline=None)
@given(st.permutations(range(4)))
def test_the_order_of_the_recordings_does_not_matter_to_the_fit(order):
    model = grey()
    rows = rows_of(model, 4, sensor=True)
    straight = fitted(model, "link", np.sum([each.products() for each in rows], axis=0))
    shuffled = fitted(model, "link", np.sum([rows[k].products() for k in order], axis=0))
    np.testing.assert_allclose(shuffled, straight, rtol=1e-6, atol=1e-9)
