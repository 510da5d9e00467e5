"""The regressor for scikit-learn: its own checks of estimators, and a grey box on recordings."""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn", reason="scikit-learn is not installed: pip install 'acqd[sklearn]'")
pytest.importorskip("pandas")

from sklearn import config_context
from sklearn.base import clone
from sklearn.model_selection import GroupKFold, cross_val_score
from sklearn.utils.estimator_checks import parametrize_with_checks

import acqd
from acqd.api.estimator import PowerRegressor
from acqd.robot.toml_text import description_text
from tests.robot.sliding import link, turn

OF_SEQUENCES = {
    "check_methods_sample_order_invariance": "rows are a sequence: in another order they are another motion",
    "check_methods_subset_invariance": "velocities, the supply's lag and a network's state need the rows before",
}


@cache
def arm(axes):
    """The description of a robot with so many joints."""
    joints = [turn(f"j{k}", [0, k % 2, 1 - k % 2], link(2.0, (0, 0.1, 0.1)), xyz=[0, 0, 0.2]) for k in range(axes)]
    table = {"name": f"arm{axes}", "title": "arm", "sources": ["made"], "base": {"mass": 1}, "joint": joints}
    path = Path(tempfile.mkdtemp(prefix="acqd-test-")) / f"arm{axes}.toml"
    path.write_text(description_text(table | {"flange": {"xyz": [0, 0, 0.1]}}))
    return str(path)


class AnyArm(PowerRegressor):
    """A grey box of a robot with as many joints as X has columns: the checks come with 1 to 10 columns."""

    def __init__(self, network="grey-box"):
        super().__init__(network)

    def _robot_of(self, axes):
        return arm(axes)


@parametrize_with_checks(
    [PowerRegressor("7x1dim", epochs=2), PowerRegressor("3conv1x5", epochs=2), AnyArm()],
    expected_failed_checks=lambda _: OF_SEQUENCES,
)
def test_checks_of_scikit_learn(estimator, check):
    check(estimator)


def frame_of(name):
    """Five recordings: a fit of all takes a second."""
    frame = acqd.Dataset(name).to_pandas().query("valid")
    return frame[frame["recording"].isin(frame["recording"].unique()[:5])]


def rows_of(name):
    frame = frame_of(name)
    return frame[[f"q{k}" for k in range(1, 7)]], frame["P"], frame["recording"]


def test_a_grey_box_predicts_recordings_that_it_has_not_seen(folder):
    X, y, groups = rows_of("ds")
    with config_context(enable_metadata_routing=True):
        model = PowerRegressor("grey-box", robot="ur10e").set_fit_request(groups=True).set_score_request(groups=True)
        scores = cross_val_score(model, X, y, cv=GroupKFold(2), params={"groups": groups})
    assert min(scores) > 0.95, scores
    assert clone(model).get_params() == model.get_params()


def test_recordings_are_predicted_apart(folder):
    X, y, groups = rows_of("ds")
    model = PowerRegressor("grey-box", robot="ur10e").fit(X, y, groups=groups)
    whole = model.predict(X, groups=groups)
    for name in groups.unique()[:1]:
        rows = (groups == name).to_numpy()
        np.testing.assert_array_equal(whole[rows], model.predict(X[rows]))


def test_signals_are_further_columns(folder):
    X, y, groups = rows_of("ds")
    brake = frame_of("ds")["brake"]
    model = PowerRegressor("grey-box", robot="ur10e", signals=("brake",))
    model.fit(X.assign(brake=brake), y, groups=groups)
    assert model.predictor_.signals == ("brake",)
    shut = model.predict(X.assign(brake=0.0), groups=groups)
    assert np.abs(shut - model.predict(X.assign(brake=brake), groups=groups)).max() > 1.0


def test_a_wrong_number_of_joints_is_named():
    with pytest.raises(ValueError, match="X has 3 joint angles, but ur3e has 6 joints"):
        PowerRegressor(robot="ur3e").fit(np.zeros((50, 3)), np.arange(50.0))
    with pytest.raises(ValueError, match="needs a robot description"):
        PowerRegressor().fit(np.zeros((50, 3)), np.arange(50.0))
    with pytest.raises(ValueError, match="no network 'forest'"):
        PowerRegressor("forest").fit(np.zeros((50, 3)), np.arange(50.0))
