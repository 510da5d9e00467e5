"""The scale of a model's torques from described masses, and what their uncertainty costs."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.torque_scale import GUESSED_DRIVE_DEVIATION, TorqueScale, drive_deviation, torque_scale
from tests.builders import STEP, recording

UNCALIBRATED = SimpleNamespace(metadata={})


def scale_of(model, robot, heavier=1.0, bundle=UNCALIBRATED, **changed):
    """The scale where every described link is `heavier` times that of the model's robot."""
    joints = [
        joint.model_copy(update={"link": joint.link.model_copy(update={
            "mass": heavier * joint.link.mass, "inertia": [heavier * value for value in joint.link.inertia]
        })}) for joint in robot.joint
    ]  # fmt: skip
    described = robot.model_copy(update={"joint": joints} | changed)
    fit = [recording(model, k) for k in range(2)]
    data = SimpleNamespace(step_s=STEP)
    return torque_scale(
        Subject(bundle, model, model, described, data, "change", fit, [], [], frozenset(), frozenset(), [])
    )


def test_the_scale_lies_between_the_described_masses_and_the_nominal_drives(model, robot):
    assert scale_of(model, robot).value == pytest.approx(1.0, abs=0.01)
    trusted, doubted = (scale_of(model, robot, 1.25, mass_deviation=share) for share in (0.001, 0.9))
    assert trusted.value == pytest.approx(1 / 1.25, abs=0.01)
    assert doubted.value == pytest.approx(1.0, abs=0.02)


def test_masses_that_err_independently_leave_less_uncertainty_than_one_of_them(model, robot):
    sure, unsure = (scale_of(model, robot, mass_deviation=share).deviation for share in (0.02, 0.2))
    assert 0.2 * 0.02 < sure < 0.02
    assert sure < unsure < robot.drive_deviation


def test_well_known_drives_leave_less_uncertainty(model, robot):
    usual, identified = (scale_of(model, robot, drive_deviation=share) for share in (0.1, 0.03))
    assert identified.deviation < 0.03 < usual.deviation < 0.1


def test_torque_sensors_need_no_masses(model, robot):
    fit = [replace(each, tau=each.q) for each in [recording(model, k) for k in range(2)]]
    subject = Subject(
        SimpleNamespace(metadata={}), model, model, robot, None, "change", fit, [], [], frozenset(), frozenset(), []
    )
    assert torque_scale(subject).value == 1.0


def with_guessed_drives(robot):
    return [joint.model_copy(update={"guessed": ["drive"]}) for joint in robot.joint]


def test_guessed_drives_leave_the_scale_to_the_described_masses(model, robot):
    guessed = robot.model_copy(update={"joint": with_guessed_drives(robot)})
    known, unknown = (scale_of(model, each, 1.25, mass_deviation=0.2) for each in (robot, guessed))
    assert abs(unknown.value - 1 / 1.25) < abs(known.value - 1 / 1.25)
    assert known.deviation < unknown.deviation
    assert drive_deviation(guessed) == GUESSED_DRIVE_DEVIATION
    assert drive_deviation(guessed.model_copy(update={"drive_deviation": 0.05})) == 0.05


def test_a_calibrated_scale_replaces_masses_and_drives(model, robot):
    bundle = SimpleNamespace(metadata={"torque_scale": {"value": 1.3, "deviation": 0.02}})
    assert scale_of(model, robot, bundle=bundle) == TorqueScale(1.3, 0.02)
