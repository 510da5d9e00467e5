"""Unnamed torque laws."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acqd.discrepancy.regression.torque_alternatives import single_laws, torque_columns, torque_groups
from acqd.models.effects.laws.law import MotionRange
from acqd.models.effects.laws.torque_laws import play
from acqd.models.effects.scene import segment_scene
from tests.builders import AXES, grey, recording


def covered(low, high, fastest):
    return MotionRange(low, high, fastest, np.ones(AXES), np.zeros(4))


def names():
    return [group.law.label(group.joint) for group in torque_groups(AXES) for _ in group.columns]


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=60), st.floats(0.01, 1.0))
def test_play_follows_within_its_width_and_only_when_pushed(values, width):
    followed = play(np.array(values), width, values[0])
    assert np.all(np.abs(followed - values) <= width + 1e-12)
    moved = np.diff(followed) != 0
    assert np.all(np.abs(followed - values)[1:][moved] >= width - 1e-12)


def test_as_many_columns_as_the_groups_say():
    model = grey()
    scene = segment_scene(model, recording(model, 1, rows=60))
    columns = torque_columns(scene, covered(np.full(AXES, -3.0), np.full(AXES, 3.0), np.ones(AXES)))
    assert len(columns) == len(names()) and len(set(names())) == len(torque_groups(AXES))
    assert all(column.shape == (len(scene.q),) and np.isfinite(column).all() for column in columns)


def test_friction_in_one_place_of_a_joint_follows_its_angle():
    model = grey()
    scene = segment_scene(model, recording(model, 1, rows=400))
    columns = np.column_stack(torque_columns(scene, covered(scene.q.min(axis=0), scene.q.max(axis=0), np.ones(AXES))))
    law = columns[:, [name == "a friction that depends on the angle of joint 2" for name in names()]]
    middle = scene.q[:, 1].mean()
    power = scene.power_per_torque[:, 1] * np.tanh(scene.qd[:, 1] / 0.01) / (1 + np.exp(-8 * (scene.q[:, 1] - middle)))
    shares = []
    for X in (law, law[:, :1]):  # the first column is friction of the same size everywhere
        left = power - X @ np.linalg.lstsq(X, power, rcond=None)[0]
        shares.append(1 - (left @ left) / (power @ power))
    assert shares[0] > 0.95 and shares[1] < 0.8


def test_a_friction_curve_covers_all_speeds_also_those_that_few_rows_exceed():
    model = grey()
    scene = segment_scene(model, recording(model, 1, rows=200))
    usual = np.abs(scene.qd).max(axis=0) / 2
    columns = np.column_stack(torque_columns(scene, covered(np.full(AXES, -3.0), np.full(AXES, 3.0), usual)))
    curve = columns[:, [name == "a friction of joint 2 of another curve over its speed" for name in names()]]
    slope, speed = scene.power_per_torque[:, 1], scene.qd[:, 1]
    for law, share in ((speed, 0.9999), (np.sign(speed) * np.abs(speed) ** 3, 0.99)):
        power = slope * law
        left = power - curve @ np.linalg.lstsq(curve, power, rcond=None)[0]
        assert 1 - (left @ left) / (power @ power) > share


def test_a_law_of_one_coefficient_is_what_its_name_says():
    model = grey()
    scene = segment_scene(model, recording(model, 1, rows=400))
    fastest = np.abs(scene.qd).max(axis=0)
    columns = torque_columns(scene, covered(scene.q.min(axis=0), scene.q.max(axis=0), fastest))
    laws = {}
    for name, single in single_laws(AXES):
        first = names().index(single.law.label(single.joint))
        laws[name] = columns[first + single.columns[0]]
    along = scene.power_per_torque[:, 1] * np.tanh(scene.qd[:, 1] / 0.01)
    above = np.maximum(np.abs(scene.qd[:, 1]) - 0.3 * fastest[1], 0.0)
    for name, power in (
        ("a friction of joint 2 that grows with the speed of joint 1", along * np.abs(scene.qd[:, 0])),
        ("a friction of joint 2 that begins above 30 % of its highest speed", along * above),
    ):
        assert np.corrcoef(laws[name], power)[0, 1] > 0.999
