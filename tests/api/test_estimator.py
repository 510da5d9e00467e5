"""The regressor for scikit-learn: its own checks of estimators, and a grey box on recordings."""

import contextlib
from importlib.util import find_spec

import numpy as np
import pytest

import acqd

pytestmark = [
    pytest.mark.xdist_group("scikit-learn"),  # and imported in tests: one worker imports it, for seconds
    pytest.mark.skipif(
        find_spec("sklearn") is None or find_spec("pandas") is None, reason="pip install 'acqd[sklearn,pandas]'"
    ),
]


def regressor(*arguments, **settings):
    from acqd.api.estimator import PowerRegressor

    return PowerRegressor(*arguments, **settings)


OF_SEQUENCES = {
    "check_methods_sample_order_invariance": "rows are a sequence: in another order they are another motion",
    "check_methods_subset_invariance": "velocities, the supply's lag and a network's state need the rows before",
}


@pytest.mark.parametrize("network", ["7x1dim", "3conv1x5", pytest.param("grey-box", marks=pytest.mark.slow)])
def test_checks_of_scikit_learn(network):
    from sklearn.utils.estimator_checks import check_estimator

    from tests.api.any_arm import AnyArm

    estimator = AnyArm() if network == "grey-box" else regressor(network, epochs=2)
    results = check_estimator(estimator, on_fail=None, on_skip=None, expected_failed_checks=OF_SEQUENCES)
    assert len(results) > 40
    failed = {each["check_name"]: each["exception"] for each in results if each["status"] == "failed"}
    assert not failed, failed


def frame_of(name):
    """Five recordings: a fit of all takes a second."""
    frame = acqd.Dataset(name).to_pandas().query("valid")
    return frame[frame["recording"].isin(frame["recording"].unique()[:5])]


def rows_of(name):
    frame = frame_of(name)
    return frame[[f"q{k}" for k in range(1, 7)]], frame["P"], frame["recording"]


def test_a_grey_box_predicts_recordings_that_it_has_not_seen(folder):
    from sklearn import config_context
    from sklearn.base import clone
    from sklearn.model_selection import GroupKFold, cross_val_score

    X, y, groups = rows_of("ds")
    with config_context(enable_metadata_routing=True):
        model = regressor("grey-box", robot="ur10e")
        scores = cross_val_score(model, X, y, cv=GroupKFold(2), params={"groups": groups})
    assert min(scores) > 0.95, scores
    assert clone(model).get_params() == model.get_params()


def test_recordings_are_predicted_apart(folder):
    X, y, groups = rows_of("ds")
    model = regressor("grey-box", robot="ur10e").fit(X, y, groups=groups)
    whole = model.predict(X, groups=groups)
    for name in groups.unique()[:1]:
        rows = (groups == name).to_numpy()
        np.testing.assert_array_equal(whole[rows], model.predict(X[rows]))


def test_signals_are_further_columns(folder):
    X, y, groups = rows_of("ds")
    brake = frame_of("ds")["brake"]
    model = regressor("grey-box", robot="ur10e", signals=("brake",))
    model.fit(X.assign(brake=brake), y, groups=groups)
    assert model.predictor_.signals == ("brake",)
    shut = model.predict(X.assign(brake=0.0), groups=groups)
    assert np.abs(shut - model.predict(X.assign(brake=brake), groups=groups)).max() > 1.0


def test_a_wrong_number_of_joints_is_named():
    with pytest.raises(ValueError, match="X has 3 joint angles, but ur3e has 6 joints"):
        regressor(robot="ur3e").fit(np.zeros((50, 3)), np.arange(50.0))
    with pytest.raises(ValueError, match="needs a robot description"):
        regressor().fit(np.zeros((50, 3)), np.arange(50.0))
    with pytest.raises(ValueError, match="no network 'forest'"):
        regressor("forest").fit(np.zeros((50, 3)), np.arange(50.0))


def test_rows_that_are_no_motion_of_the_robot_are_named(folder):
    X, y, groups = rows_of("ds")
    order = np.random.default_rng(0).permutation(len(X))
    model = regressor("grey-box", robot="ur10e")
    with pytest.raises(ValueError, match="Rows must be in the order of time"):
        model.fit(X.iloc[order], y.iloc[order])
    with pytest.raises(ValueError, match="are not consecutive"):
        model.fit(X, y, groups=np.arange(len(X)) % 2)
    model.fit(X, y, groups=groups)
    mixed = np.concatenate([np.flatnonzero(groups == name)[100:200] for name in groups.unique()])
    with pytest.raises(ValueError, match="groups= names the recording of each"):
        model.score(X.iloc[mixed], y.iloc[mixed])


def test_a_recording_cut_in_motion_has_the_power_of_the_whole(folder):
    X, y, groups = rows_of("ds")
    model = regressor("grey-box", robot="ur10e").fit(X, y, groups=groups)
    first = X[groups == groups.iloc[0]]
    whole = model.predict(first)
    off = [model.predict(first[cut : cut + 150])[[0, -1]] - whole[[cut, cut + 149]] for cut in range(20, 500, 7)]
    assert np.median(np.abs(off)) < 2 and np.percentile(np.abs(off), 90) < 10  # W; hundreds if the arm rested outside
    piece = first[150:350]
    truth = whole[150:350].copy()
    truth[[0, -1]] += 500.0
    assert model.score(piece, truth) > 0.9  # their accelerations are not known, and they do not count
    with pytest.warns(UserWarning):
        model.fit(piece, truth)
    assert np.abs(model.predict(piece) - whole[150:350]).max() < 50


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"step_s": 40}, "expected the seconds between rows"),
        ({"step_s": 0}, "expected the seconds between rows"),
        ({"step_s": "0.04"}, "expected the seconds between rows"),
        ({"signals": ("tool",)}, "X has 5 joint angles, then the signals tool, but ur10e has 6 joints"),
    ],
)
def test_settings_that_are_no_description_of_the_rows_are_named(settings, line):
    with pytest.raises(ValueError, match=line):
        regressor(robot="ur10e", **settings).fit(np.zeros((50, 6)), np.arange(50.0))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_robot_may_be_a_description_and_rows_without_a_group_are_named(folder):
    X, y, groups = rows_of("ds")
    same = regressor("grey-box", robot=acqd.Robot("ur10e")).fit(X, y, groups=groups)
    assert same.score(X, y, groups=groups) > 0.9
    with pytest.raises(ValueError, match="row 8 has no group"):
        same.fit(X, y, groups=groups.where(np.arange(len(X)) != 7))


@pytest.mark.parametrize("none", ["None", "nan", "NA", "NaT"])
@pytest.mark.parametrize("dtype", [object, "string"])
def test_a_row_without_a_group_is_named_whatever_stands_for_none(none, dtype):
    import pandas as pd

    from acqd.api.estimator import _recordings

    nothing = {"None": None, "nan": float("nan"), "NA": pd.NA, "NaT": pd.NaT}[none]
    with pytest.raises(ValueError, match="row 3 has no group"):
        _recordings(pd.Series(["a", "a", nothing, "b"], dtype=dtype), 4)


def test_groups_may_be_a_table_of_one_column_and_no_more():
    import pandas as pd

    from acqd.api.estimator import _recordings

    groups = pd.DataFrame({"recording": ["a", "a", "b"]})
    assert _recordings(groups, 3) == [slice(0, 2), slice(2, 3)]
    with pytest.raises(ValueError, match="groups has 2 values in a row"):
        _recordings(groups.assign(day=1), 3)


def copies(X, y, groups):
    rows = np.repeat(np.arange(len(X)), np.where(np.arange(len(X)) % 40 == 39, 2, 1))
    return X.iloc[rows], y.iloc[rows], groups.iloc[rows]


@pytest.mark.parametrize(
    ("mistaken", "line"),
    [
        (lambda X, y, groups: ((X - X.mean()) / X.std(ddof=0), y, groups), "has a scaler changed them"),
        (lambda X, y, groups: (X.round(), y, groups), "all angles are whole numbers"),
        (lambda X, y, groups: (X, y.shift(25).bfill(), groups), "s after the motion that causes it"),
        (lambda X, y, groups: (X, y.sample(frac=1, random_state=0), groups), "% of the changes of the power"),
        (lambda X, y, groups: (X, 60 + 0 * y, groups), "the power is 60 W in all rows"),
        (copies, "rows repeat the row before while the arm moves"),
    ],
    ids=["standardised", "rounded", "late", "shuffled", "constant", "copies"],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_no_robot_measures_is_doubted(folder, mistaken, line):
    X, y, groups = mistaken(*rows_of("ds"))
    with pytest.warns(UserWarning, match=line), contextlib.suppress(ValueError):  # beyond the limits, perhaps
        regressor("grey-box", robot="ur10e").fit(X, y, groups=groups)


def test_a_score_in_another_unit_is_doubted(folder):
    X, y, groups = rows_of("ds")
    with pytest.warns(UserWarning):
        model = regressor("grey-box", robot="ur10e").fit(X, y, groups=groups)
    with pytest.warns(UserWarning, match="is it in kW"):
        model.score(X, y / 1000, groups=groups)
