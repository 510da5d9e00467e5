"""The chart of logged torques: what the power does not show raises an alarm that names the joint."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.models.augmented import Augmented
from acqd.models.bundle.bundle import save_bundle
from acqd.models.bundle.reference import reference_arrays
from acqd.models.bundle.restore import open_model
from acqd.models.metrics import predictions
from acqd.monitor.baseline import baseline_of
from acqd.monitor.cusum import Monitor
from acqd.monitor.joint_chart import grey_box_of
from acqd.residual.residuals import errors_of
from tests.builders import ROBOT, grey, grey_bundle, term
from tests.discrepancy.joints.test_witness import logged

COUNT = 30


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """A model and the baselines of bundles that remember sensors' torques, currents and no torques."""
    folder, model = tmp_path_factory.mktemp("bundles"), grey()
    with_torques = [logged(model, number, 1, sensor=True) for number in range(COUNT)]
    with_currents = [logged(model, number, 1) for number in range(COUNT)]
    remembered = {"link": with_torques, "motor": with_currents, "": [replace(s, tau=None) for s in with_torques]}
    baselines = {}
    for side, segments in remembered.items():
        save_bundle(folder / f"model{side}", grey_bundle(reference_arrays(segments)))
        baselines[side] = baseline_of(folder / f"model{side}", open_model(folder / f"model{side}")[1], 3600 * 200.0)
    return model, baselines


def first_alarm(model, baseline, segments):
    monitor = Monitor(baseline)
    whole = zip(segments, errors_of(model, segments), predictions(model, segments), strict=True)
    alarms = (monitor.update(errors, guess, s.start_s, model.step_s, s) for s, errors, guess in whole)
    return next((alarm for alarm in alarms if alarm is not None), None)


def later(model, *, sensor=True, **change):
    return [logged(model, number, 2, sensor=sensor, **change) for number in range(COUNT)]


@pytest.mark.parametrize("sensor", [True, False])
def test_unchanged_torques_raise_no_alarm(watched, sensor):
    model, baselines = watched
    assert first_alarm(model, baselines["link" if sensor else "motor"], later(model, sensor=sensor)) is None


def test_a_torque_sensor_that_is_off_does_not_show_in_the_power_and_raises_the_alarm(watched):
    model, baselines = watched
    bias = np.eye(len(ROBOT.joint))[2] * 1.5
    changed = [replace(segment, tau=segment.tau + bias) for segment in later(model)]
    alarm = first_alarm(model, baselines["link"], changed)
    assert alarm is not None and alarm.chart == "joint torque up" and alarm.joint == 3
    assert alarm.as_json()["joint"] == 3 and alarm.onset_s == pytest.approx(changed[0].start_s, abs=60)
    assert first_alarm(model, baselines["link"], [replace(s, tau=None) for s in changed]) is None


def test_friction_in_the_currents_raises_the_alarm(watched):
    model, baselines = watched
    alarm = first_alarm(model, baselines["motor"], later(model, sensor=False, friction=3.0))
    assert alarm is not None and alarm.chart == "joint torque up" and alarm.joint == 2


def test_without_logged_torques_there_is_no_chart(watched):
    _, baselines = watched
    assert baselines[""].joints is None and np.isinf(baselines[""].all_bounds()[5])


def test_a_repaired_model_has_the_dynamics_of_its_grey_box():
    model = grey()
    assert grey_box_of(Augmented(model, model, [term("payload")])) is model
    assert grey_box_of(object()) is None
